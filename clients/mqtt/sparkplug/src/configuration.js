// SPDX-License-Identifier: Apache-2.0
// The configuration file. README.md has its fields.
import {readFileSync} from 'node:fs';
import path from 'node:path';

const text = (value) => typeof value === 'string' && value !== '';
// Ids of Sparkplug are levels of a topic (4.1.2); a reserved character would make another topic.
const id = (value) => text(value) && value.length <= 64 && !/[/+#\0]/.test(value);
const object = (value) => typeof value === 'object' && value !== null && !Array.isArray(value);

const FIELDS = {
  group: [id, 'a text without "/", "+" and "#"'],
  node: [id, 'a text without "/", "+" and "#"'],
  prefix: [(value) => text(value) && !/[+#\0]/.test(value), 'the value of --mqtt-prefix'],
  state: [text, 'a file'],
  broker: [object, 'an object with url'],
  service: [object, 'an object with url'],
};
const BROKER_FIELDS = {
  url: [(value) => text(value) && /^mqtts?:\/\//.test(value), 'mqtt://HOST:PORT or mqtts://HOST:PORT'],
  user: [text, 'a user name'],
  password_file: [text, 'a file'],
  ca: [text, 'a PEM file'],
  certificate: [text, 'a PEM file'],
  key: [text, 'a PEM file'],
};
const SERVICE_FIELDS = {
  url: [(value) => text(value) && /^https?:\/\//.test(value), 'http://HOST:PORT or https://HOST:PORT'],
  token_files: [object, 'files by client name'],
};

function check(value, fields, required, place) {
  if (!object(value)) throw new Error(`${place || 'the file'}: must be an object`);
  for (const [name, item] of Object.entries(value)) {
    if (!Object.hasOwn(fields, name)) throw new Error(`${place}${name}: is no field; fields are ${Object.keys(fields).join(', ')}`);
    const [is_valid, must_be] = fields[name];
    if (!is_valid(item)) throw new Error(`${place}${name}: must be ${must_be}`);
  }
  for (const name of required) {
    if (!Object.hasOwn(value, name)) throw new Error(`${place}${name}: is missing; must be ${fields[name][1]}`);
  }
}

// File names are relative to the configuration's folder. `broker` of the answer has the options of
// mqtt.connect. Throws an Error with the field and what it must be.
export function readConfiguration(file) {
  try {
    const {broker, service, ...rest} = JSON.parse(readFileSync(file, 'utf8'));
    check({broker, ...(service === undefined ? {} : {service}), ...rest}, FIELDS, ['group', 'node', 'state', 'broker'], '');
    check(broker, BROKER_FIELDS, ['url'], 'broker.');
    if (service !== undefined) check(service, SERVICE_FIELDS, ['url'], 'service.');
    const resolve = (name) => path.resolve(path.dirname(path.resolve(file)), name);
    const read = (name) => name && readFileSync(resolve(name));
    const token_files = Object.entries(service?.token_files ?? {}).map(([client, name]) => [client, resolve(name)]);
    return {prefix: 'sightline', ...rest, state: resolve(rest.state),
      service: service && {...service, token_files: Object.fromEntries(token_files)},
      broker: {url: broker.url, username: broker.user, password: read(broker.password_file)?.toString('utf8').trim(),
        ca: read(broker.ca), cert: read(broker.certificate), key: read(broker.key)}};
  } catch (error) {
    throw new Error(`${file}: ${error.message}`);
  }
}

// SPDX-License-Identifier: Apache-2.0
// Payloads of Sparkplug B as bytes. A metric is {name, type, value, timestamp}: type is a key of
// TYPES, value null for none, timestamp in milliseconds since 1970-01-01 UTC.
import {fileURLToPath} from 'node:url';
import protobuf from 'protobufjs';

const Payload = new protobuf.Root().loadSync(fileURLToPath(new URL('sparkplug_b.proto', import.meta.url)), {keepCase: true})
    .lookupType('sightline.sparkplug.Payload');

// Number of the data type (6.4.16) and the field of its value.
export const TYPES = {
  Int64: {number: 4, field: 'long_value'},
  UInt64: {number: 8, field: 'long_value'},
  Double: {number: 10, field: 'double_value'},
  Boolean: {number: 11, field: 'boolean_value'},
  String: {number: 12, field: 'string_value'},
};

// The `root` option has 64-bit numbers as Long or as number; both are given back as numbers.
const TO_OBJECT = {longs: Number};

// `seq` is left out of an NDEATH (6.4.25).
export function encodePayload({timestamp, metrics, seq}) {
  const message = Payload.fromObject({timestamp, ...(seq === undefined ? {} : {seq}), metrics: metrics.map((metric) => {
    const {number, field} = TYPES[metric.type];
    return {name: metric.name, timestamp: metric.timestamp ?? timestamp, datatype: number,
      ...(metric.value === null ? {is_null: true} : {[field]: metric.value})};
  })});
  return Buffer.from(Payload.encode(message).finish());
}

// Metrics of a command, as [{name, value}]; undefined where the value is of a type that no command of
// ours has. Throws an Error when the bytes are no payload.
export function decodeCommand(bytes) {
  const {metrics = []} = Payload.toObject(Payload.decode(bytes), TO_OBJECT);
  const fields = [...new Set(Object.values(TYPES).map((type) => type.field))];
  return metrics.map((metric) => ({name: metric.name, value: metric[fields.find((field) => metric[field] !== undefined)]}));
}

// SPDX-License-Identifier: Apache-2.0
// An edge node of Sparkplug B (specification 3.0.0) with its devices: births, deaths, sequence numbers
// and rebirths. Each connection has a birth-death number of its own, which its will states too.
import mqtt from 'mqtt';
import {CANCEL, deviceBirth, deviceId, jobMetrics, nodeBirth, REBIRTH} from './job_metrics.js';
import {decodeCommand, encodePayload} from './payload.js';

const NAMESPACE = 'spBv1.0';
const RECONNECT_MS = [500, 1000, 2000, 5000, 10_000];

export class EdgeNode {
  // `broker`: {url, ...options of mqtt.connect}; `state`: StateFile; `cancel(client, job_id)` returns a
  // promise of the service's answer.
  constructor({group, node}, broker, state, cancel) {
    Object.assign(this, {group, node, broker, state, cancel});
    this.is_online = false;
    this.is_born = false;  // an NBIRTH comes before everything else of a connection
    this.seq = 0;
    this.failures = 0;
  }

  topic(type, client) {
    return [NAMESPACE, this.group, type, this.node, ...(client === undefined ? [] : [deviceId(client)])].join('/');
  }

  start() {
    if (this.is_stopped) return;
    this.bd_seq = this.state.nextBirth();
    const {url, ...options} = this.broker;
    const connection = mqtt.connect(url, {...options, clean: true, reconnectPeriod: 0, keepalive: 20,
      will: {topic: this.topic('NDEATH'), payload: this.death(), qos: 1, retain: false}});
    this.connection = connection;
    connection.on('error', (error) => console.error(`broker ${url}: ${error.message}`));
    connection.once('close', () => {
      this.is_born = false;
      this.reconnect();
    });
    connection.on('message', (topic, payload) => this.command(topic, payload));
    connection.on('connect', () => this.open(connection).catch((error) => {
      console.error(`broker ${url}: ${error.message}`);
      connection.end(true);
    }));
  }

  // Commands first, so that none is missed that follows the birth.
  async open(connection) {
    await connection.subscribeAsync([this.topic('NCMD'), `${this.topic('DCMD')}/+`], {qos: 1});
    await this.birth();
    this.failures = 0;
    console.log(`edge node ${this.group}/${this.node} is born, bdSeq ${this.bd_seq}`);
  }

  reconnect() {
    if (this.is_stopped) return;
    const delay = RECONNECT_MS[Math.min(this.failures++, RECONNECT_MS.length - 1)];
    this.timer = setTimeout(() => this.start(), delay);
  }

  death() {
    const metrics = [{name: 'bdSeq', type: 'Int64', value: this.bd_seq}];
    return encodePayload({timestamp: Date.now(), metrics});
  }

  // Births, deaths of devices and data count on from 0 to 255, and again from 0.
  async publish(type, metrics, client) {
    if (!this.connection?.connected || (!this.is_born && type !== 'NBIRTH')) throw new Error('there is no connection to the broker');
    const seq = this.seq;
    this.seq = (this.seq + 1) % 256;
    await this.connection.publishAsync(this.topic(type, client), encodePayload({timestamp: Date.now(), metrics, seq}), {qos: 0, retain: false});
  }

  async birth() {
    this.seq = 0;
    await this.publish('NBIRTH', nodeBirth(this.bd_seq, this.is_online));
    this.is_born = true;
    if (!this.is_online) return;
    for (const [client, event] of this.state.devices) await this.publish('DBIRTH', deviceBirth(event), client);
  }

  // The service is there, or not: its clients' devices are born and die with it.
  async setOnline(is_online) {
    if (is_online === this.is_online) return;
    this.is_online = is_online;
    if (!this.is_born) return;
    await this.publish('NDATA', [{name: 'Service/Online', type: 'Boolean', value: is_online}]);
    for (const [client, event] of this.state.devices) {
      await this.publish(is_online ? 'DBIRTH' : 'DDEATH', is_online ? deviceBirth(event) : [], client);
    }
  }

  // Publishes an event that is new. Throws when it could not be: the broker gives it again.
  async event(event) {
    if (!this.state.isNew(event)) return;
    const {client} = event.job;
    const is_known = this.state.devices.has(client);
    await this.setOnline(true);
    await this.publish(is_known ? 'DDATA' : 'DBIRTH', is_known ? jobMetrics(event) : deviceBirth(event), client);
    this.state.note(event);
  }

  // NCMD and DCMD. What they ask for otherwise is left out, as they may be meant for later versions.
  async command(topic, payload) {
    try {
      const device = topic.slice(this.topic('DCMD').length + 1);
      const commands = new Map(decodeCommand(payload).map(({name, value}) => [name, value]));
      if (topic === this.topic('NCMD')) {
        if (commands.get(REBIRTH) === true) await this.birth();
        return;
      }
      const client = [...this.state.devices.keys()].find((name) => deviceId(name) === device);
      const job_id = commands.get(CANCEL);
      if (client !== undefined && typeof job_id === 'string' && job_id !== '') await this.cancel(client, job_id);
    } catch (error) {
      console.error(`${topic}: ${error.message}`);
    }
  }

  // A broker does not send the will of a connection that is closed in order.
  async stop() {
    this.is_stopped = true;
    clearTimeout(this.timer);
    if (this.connection?.connected) {
      await this.connection.publishAsync(this.topic('NDEATH'), this.death(), {qos: 1, retain: false});
    }
    await this.connection?.endAsync();
  }
}

// SPDX-License-Identifier: Apache-2.0
// Events and status that the planning service publishes at a broker. The session is kept by the
// broker, and a message is confirmed when the edge node has published it: what came meanwhile is given
// again.
import mqtt from 'mqtt';
import {parseEvent} from './job_metrics.js';

const RETRY_MS = 500;

export class EventSource {
  // `configuration`: {group, node, prefix, broker}; `node`: EdgeNode.
  constructor({group, node, prefix, broker}, edge_node) {
    Object.assign(this, {prefix, broker, edge_node, client_id: `sightline-sparkplug-${group}-${node}`});
    this.is_stopped = false;
  }

  start() {
    const {url, ...options} = this.broker;
    const connection = mqtt.connect(url, {...options, clientId: this.client_id, clean: false, reconnectPeriod: 1000, resubscribe: false});
    this.connection = connection;
    // The library confirms a message when this calls back.
    connection.handleMessage = (packet, confirm) => {
      this.take(packet).then(() => {
        if (!this.is_stopped) confirm();
      });
    };
    connection.on('error', (error) => console.error(`broker ${url}: ${error.message}`));
    connection.on('connect', () => connection.subscribe([`${this.prefix}/status`, `${this.prefix}/jobs/+/+`], {qos: 1}));
  }

  // Tries until the edge node has published it. A message that is no event is left out.
  async take({topic, payload}) {
    let event;
    try {
      if (topic !== `${this.prefix}/status`) event = parseEvent(payload);
    } catch (error) {
      console.error(`${topic}: is left out: ${error.message}`);
      return;
    }
    while (!this.is_stopped) {
      try {
        await (event ? this.edge_node.event(event) : this.edge_node.setOnline(payload.toString() === 'online'));
        return;
      } catch {
        await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
      }
    }
  }

  async stop() {
    this.is_stopped = true;
    await this.connection.endAsync(true);
  }
}

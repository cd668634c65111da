#!/usr/bin/env node
// SPDX-License-Identifier: Apache-2.0
// Publishes the job events of a planning service (`sightline serve --mqtt`) as an edge node of
// Sparkplug B.
//
//   node sparkplug.js CONFIGURATION.json
//
// README.md has the configuration. SIGTERM and SIGINT end it in order.
import {readConfiguration} from './src/configuration.js';
import {EventSource} from './src/event_source.js';
import {EdgeNode} from './src/edge_node.js';
import {cancelJob} from './src/cancel_job.js';
import {StateFile} from './src/state_file.js';

function main([file]) {
  if (!file) throw new Error('usage: node sparkplug.js CONFIGURATION.json');
  const configuration = readConfiguration(file);
  const state = new StateFile(configuration.state);
  const node = new EdgeNode(configuration, configuration.broker, state, (client, job_id) => cancelJob(configuration.service, client, job_id));
  const source = new EventSource(configuration, node);
  node.start();
  source.start();
  const stop = () => source.stop().then(() => node.stop()).then(() => process.exit(0), () => process.exit(1));
  for (const signal of ['SIGTERM', 'SIGINT']) process.once(signal, stop);
}

try {
  main(process.argv.slice(2));
} catch (error) {
  console.error(error.message);
  process.exit(2);
}

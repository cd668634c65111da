#!/usr/bin/env node
// SPDX-License-Identifier: Apache-2.0
// Sightline's planning service as vision systems of OPC 40100-1.
//
//   node gateway.js CONFIGURATION.json
//   node gateway.js hash-password        (reads the password from standard input)
//
// README.md has the configuration. SIGTERM and SIGINT end it in order.
import {readFileSync} from 'node:fs';
import {hashPassword} from './src/password.js';

const [argument] = process.argv.slice(2);
if (argument === 'hash-password') {
  console.log(hashPassword(readFileSync(0, 'utf8').replace(/\r?\n$/, '')));
} else if (argument) {
  import('./src/server.js').then(({run}) => run(argument)).catch((error) => {
    console.error(error.message);
    process.exit(2);
  });
} else {
  console.error('usage: node gateway.js CONFIGURATION.json | hash-password');
  process.exit(2);
}

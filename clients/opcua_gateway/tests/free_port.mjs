// SPDX-License-Identifier: Apache-2.0
import {createServer} from 'node:net';

// A port of the loopback that nobody listens on.
export async function freePort() {
  const server = createServer().listen(0, '127.0.0.1');
  await new Promise((resolve) => server.once('listening', resolve));
  const {port} = server.address();
  await new Promise((resolve) => server.close(resolve));
  return port;
}

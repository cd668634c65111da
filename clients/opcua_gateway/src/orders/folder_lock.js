// SPDX-License-Identifier: Apache-2.0
// One gateway at a time in a folder: a second one would rewrite the ledgers that the first one appends to.
//
// The lock is a Unix socket in the folder that its owner listens at. The kernel ends that when the process
// dies in whatever way, and it counts for containers that share the folder on one machine.
import {closeSync, openSync, rmSync, statSync} from 'node:fs';
import net from 'node:net';
import {setTimeout as sleep} from 'node:timers/promises';

const NAME = 'gateway.lock';
// Two gateways that find the socket of a dead one at the same moment both make a new one. The later one wins;
// the other one sees within this time that the file is not its own.
const SETTLING_MS = 200;

function isAnswered(address) {
  return new Promise((resolve) => {
    const socket = net.connect(address);
    socket.once('connect', () => {
      socket.destroy();
      resolve(true);
    });
    socket.once('error', () => resolve(false));
  });
}

function listen(address) {
  return new Promise((resolve, reject) => {
    const server = net.createServer((socket) => socket.destroy());
    server.once('error', reject);
    server.listen(address, () => resolve(server));
    server.unref();
  });
}

// Resolves to {close()}. Throws an Error where another gateway has the folder.
export async function lockFolder(folder) {
  // Addresses of sockets have 107 bytes at most; this one is short wherever the folder is.
  const descriptor = openSync(folder, 'r');
  const address = `/proc/self/fd/${descriptor}/${NAME}`;
  const taken = () => new Error(`${folder}: another gateway is running with this folder`);
  try {
    if (await isAnswered(address)) throw taken();
    rmSync(address, {force: true});
    const server = await listen(address).catch((error) => {
      throw error.code === 'EADDRINUSE' ? taken() : error;
    });
    const {ino} = statSync(address);
    await sleep(SETTLING_MS);
    if (statSync(address, {throwIfNoEntry: false})?.ino !== ino) {
      server.close();
      throw taken();
    }
    return {close: () => {
      server.close();
      closeSync(descriptor);
    }};
  } catch (error) {
    closeSync(descriptor);
    throw error;
  }
}

// SPDX-License-Identifier: Apache-2.0
// One gateway at a time in a folder: a second one would rewrite the ledgers that the first one appends to.
//
// The lock is one of the kernel (flock(2)), which also counts for containers that share the folder on one
// machine. Node.js cannot take it, so that a child holds it, the program `flock` of util-linux. The child
// ends, and with it the lock, when its standard input does: at the latest with this process, however it dies.
import {spawn} from 'node:child_process';
import path from 'node:path';

// How long a new gateway waits for the lock of one that has just died.
const WAIT_S = 2;

// Resolves to {close()}. Throws an Error where another gateway has the folder, or where the lock cannot be taken.
export async function lockFolder(folder) {
  // Detached: a Ctrl-C reaches the gateway alone, which keeps the lock until it has ended.
  const child = spawn('flock', ['-w', String(WAIT_S), path.join(folder, 'gateway.lock'), 'sh', '-c', 'echo held; cat > /dev/null'],
      {stdio: ['pipe', 'pipe', 'pipe'], detached: true});
  let trouble = '';
  child.stderr.on('data', (text) => {
    trouble += text;
  });
  await new Promise((resolve, reject) => {
    child.stdout.once('data', resolve);
    child.once('error', (error) => reject(new Error(`${folder}: cannot be locked: flock of util-linux: ${error.message}`)));
    child.once('exit', () => reject(new Error(trouble ? `${folder}: cannot be locked: ${trouble.trim()}` :
      `${folder}: another gateway is running with this folder`)));
  });
  for (const handle of [child, child.stdin, child.stdout, child.stderr]) handle.unref();
  return {close: () => child.stdin.end()};
}

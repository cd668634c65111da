// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import {spawn} from 'node:child_process';
import {mkdirSync, mkdtempSync, rmSync} from 'node:fs';
import {once} from 'node:events';
import {tmpdir} from 'node:os';
import path from 'node:path';
import {after, test} from 'node:test';
import {fileURLToPath} from 'node:url';
import {lockFolder} from '../src/orders/folder_lock.js';

const work = mkdtempSync(path.join(tmpdir(), 'folder-lock-test-'));
after(() => rmSync(work, {recursive: true, force: true}));

test('one owner at a time, and the next one after it', async () => {
  const first = await lockFolder(work);
  await assert.rejects(lockFolder(work), /another gateway/);
  first.close();
  (await lockFolder(work)).close();
});

test('of several at once, one gets the lock', async () => {
  const folder = path.join(work, 'crowd');
  mkdirSync(folder);
  const locks = (await Promise.allSettled(Array.from({length: 5}, () => lockFolder(folder))))
      .filter(({status}) => status === 'fulfilled').map(({value}) => value);
  assert.equal(locks.length, 1);
  locks[0].close();
});

test('a folder that does not exist', async () => {
  await assert.rejects(lockFolder(path.join(work, 'nowhere')), /cannot be locked: .*nowhere/);
});

test('a folder with a long name', async () => {
  const folder = path.join(work, 'n'.repeat(200));
  mkdirSync(folder);
  const lock = await lockFolder(folder);
  await assert.rejects(lockFolder(folder), /another gateway/);
  lock.close();
});

test('the lock of a killed process does not count', async () => {
  const module = path.join(path.dirname(fileURLToPath(import.meta.url)), '../src/orders/folder_lock.js');
  const owner = spawn(process.execPath, ['--input-type=module', '-e',
    `const {lockFolder} = await import(${JSON.stringify(module)}); await lockFolder(${JSON.stringify(work)}); console.log('held');
     setInterval(() => {}, 1000);`], {stdio: ['ignore', 'pipe', 'inherit']});
  await once(owner.stdout, 'data');
  await assert.rejects(lockFolder(work), /another gateway/);
  owner.kill('SIGKILL');
  await once(owner, 'exit');
  (await lockFolder(work)).close();
});

// SPDX-License-Identifier: Apache-2.0
// Recipes and results as tar archives. A recipe has task.json, the PlanningTask of the service, and
// every file that the task names, under that name.
import {createReadStream, createWriteStream} from 'node:fs';
import {readFile, stat} from 'node:fs/promises';
import path from 'node:path';
import {pipeline} from 'node:stream/promises';
import tar from 'tar-stream';

const MAX_FILES = 10_000;
// A message to the service holds 64 MiB.
const MAX_TASK_BYTES = 32 << 20;

// A relative path without "..", as the service takes file names.
function isSafeName(name) {
  return name.length > 0 && name.length <= 500 && !path.isAbsolute(name) && !/[\0\\]/.test(name) &&
      name.split('/').every((part) => part !== '' && part !== '..' && part !== '.');
}

// Unpacks into the empty `folder`. Returns {task, files}: paths by name. Throws an Error that says what
// is wrong with the archive.
export async function unpackRecipe(archive, folder) {
  const extract = tar.extract();
  const files = Object.create(null);
  let count = 0;
  const reading = pipeline(createReadStream(archive), extract);
  reading.catch(() => {});  // the loop has it
  for await (const entry of extract) {
    const name = entry.header.name.replace(/^\.\//, '');
    if (entry.header.type === 'directory') {
      entry.resume();
      continue;
    }
    if (++count > MAX_FILES) throw new Error(`the recipe has more than ${MAX_FILES} files`);
    if (entry.header.type !== 'file' || !isSafeName(name)) {
      throw new Error(`${name}: must be a file with a relative name without ".."`);
    }
    if (Object.hasOwn(files, name)) throw new Error(`${name}: is in the recipe twice`);
    if (name === 'task.json' && entry.header.size > MAX_TASK_BYTES) {
      throw new Error(`task.json: is larger than ${MAX_TASK_BYTES >> 20} MiB`);
    }
    const target = path.join(folder, String(count));
    await pipeline(entry, createWriteStream(target, {mode: 0o600}));
    files[name] = target;
  }
  await reading;
  if (!files['task.json']) throw new Error('task.json: the recipe does not have it');
  let task;
  try {
    task = JSON.parse(new TextDecoder('utf-8', {fatal: true}).decode(await readFile(files['task.json'])));
  } catch (error) {
    throw new Error(`task.json: ${error.message}`);
  }
  delete files['task.json'];
  return {task, files};
}

// One archive of `files`: paths by name. Times are left out, so that the same files give the same bytes.
export async function pack(files, target) {
  const archive = tar.pack();
  const writing = pipeline(archive, createWriteStream(target, {mode: 0o600}));
  for (const [name, file] of Object.entries(files)) {
    const {size} = await stat(file);
    await pipeline(createReadStream(file), archive.entry({name, size, mtime: new Date(0)}));
  }
  archive.finalize();
  await writing;
}

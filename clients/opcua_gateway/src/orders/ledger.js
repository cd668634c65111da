// SPDX-License-Identifier: Apache-2.0
// The gateway's memory of one client: recipes, orders and events, in a file of one JSON object per
// line. Every line is on disk before the gateway acts on it, so that kill -9 at any moment loses
// nothing: an order that was noted is asked for again with the same request id, and an event keeps
// its number.
import {randomBytes} from 'node:crypto';
import {closeSync, existsSync, fsyncSync, ftruncateSync, mkdirSync, openSync, readFileSync, renameSync} from 'node:fs';
import path from 'node:path';
import {syncFolder, writeAll} from './disk.js';

const MAX_KEPT_ORDERS = 5000;
// Lines after which the file is made shorter.
const MAX_APPENDED = 20_000;

export class Ledger {
  constructor(folder) {
    mkdirSync(folder, {recursive: true, mode: 0o700});
    this.file = path.join(folder, 'ledger.jsonl');
    this.recipes = new Map();  // by internal id: {internal_id, external_id, product_id, digest, prepared}
    this.orders = new Map();   // by request id: {request_id, ..., job_id, refusal, job}
    this.events = [];          // {number, type, request_id, time, ...}
    this.id = '';
    this.last_number = 0;
    this.raised_number = 0;
    this.is_torn = false;
    const bytes = existsSync(this.file) ? readFileSync(this.file) : Buffer.alloc(0);
    // Bytes behind the last line break are a line that a crash cut off: it never counted.
    this.size = bytes.lastIndexOf('\n') + 1;
    const lines = bytes.toString('utf8', 0, this.size).split('\n').slice(0, -1);
    lines.forEach((line, i) => this.restore(line, i + 1));
    this.descriptor = openSync(this.file, 'a', 0o600);
    ftruncateSync(this.descriptor, this.size);
    this.appended = lines.length;
    if (this.id) {
      this.tryToCompact();
    } else {
      this.id = randomBytes(8).toString('hex');
      this.compact();
    }
  }

  // A damaged line may be an order or an event that was given away: nothing is guessed in its place.
  restore(line, number) {
    try {
      this.apply(JSON.parse(line));
    } catch (error) {
      throw new Error(`${this.file}: line ${number} is damaged (${error.message}); put back the file of a backup`);
    }
  }

  apply(entry) {
    if (entry.ledger) this.id = entry.ledger;
    if (entry.last_number) this.last_number = Math.max(this.last_number, entry.last_number);
    if (entry.recipe) {
      this.recipes.set(entry.recipe.internal_id, {...this.recipes.get(entry.recipe.internal_id), ...entry.recipe});
    }
    if (entry.removed_recipe) this.recipes.delete(entry.removed_recipe);
    if (entry.order) {
      const id = entry.order.request_id;
      this.orders.set(id, {...this.orders.get(id), ...entry.order});
    }
    for (const event of entry.events ?? []) {
      this.events.push(event);
      this.last_number = Math.max(this.last_number, event.number);
    }
    if (entry.raised_number) this.raised_number = entry.raised_number;
  }

  // Rewrites the file with the newest orders and their events.
  compact() {
    const finished = [...this.orders.values()].filter((order) => order.is_closed);
    for (const order of finished.slice(0, Math.max(0, finished.length - MAX_KEPT_ORDERS))) {
      this.orders.delete(order.request_id);
    }
    this.events = this.events.filter((event) => !event.request_id || this.orders.has(event.request_id))
        .slice(-4 * MAX_KEPT_ORDERS);
    const lines = [{ledger: this.id, last_number: this.last_number, raised_number: this.raised_number},
      ...[...this.recipes.values()].map((recipe) => ({recipe})),
      ...[...this.orders.values()].map((order) => ({order})), ...this.events.map((event) => ({events: [event]}))];
    const bytes = Buffer.from(lines.map((line) => JSON.stringify(line) + '\n').join(''));
    const descriptor = openSync(`${this.file}.new`, 'w', 0o600);
    try {
      writeAll(descriptor, bytes);
      fsyncSync(descriptor);
    } finally {
      closeSync(descriptor);
    }
    renameSync(`${this.file}.new`, this.file);
    syncFolder(path.dirname(this.file));
    closeSync(this.descriptor);
    this.descriptor = openSync(this.file, 'a', 0o600);
    this.size = bytes.length;
    this.appended = 0;
  }

  // A full disk leaves the file as it is: it grows until there is room again.
  tryToCompact() {
    try {
      this.compact();
    } catch (error) {
      console.error(`${this.file}: is not made shorter: ${error.message}`);
      this.appended = 0;
    }
  }

  // Several changes in one write: all of them survive a crash, or none. Events get their numbers.
  // Throws when the line is not on disk; then nothing has changed, in memory and in the file.
  write(entry) {
    const events = (entry.events ?? []).map((event, i) =>
      ({number: this.last_number + 1 + i, time: new Date().toISOString(), ...event}));
    const line = JSON.stringify({...entry, events});
    this.append(Buffer.from(line + '\n'));
    this.apply(JSON.parse(line));
    if (++this.appended > MAX_APPENDED) this.tryToCompact();
  }

  append(bytes) {
    try {
      // A write that failed may have left bytes that could not be cut off then.
      if (this.is_torn) ftruncateSync(this.descriptor, this.size);
      this.is_torn = true;
      writeAll(this.descriptor, bytes);
      fsyncSync(this.descriptor);
    } catch (error) {
      ftruncateSync(this.descriptor, this.size);
      this.is_torn = false;
      throw error;
    }
    this.size += bytes.length;
    this.is_torn = false;
  }

  // Sixteen bytes: the ledger's id and the event's number. The same event always has the same.
  eventId(number) {
    const id = Buffer.alloc(16);
    Buffer.from(this.id, 'hex').copy(id);
    id.writeBigUInt64BE(BigInt(number), 8);
    return id;
  }
}

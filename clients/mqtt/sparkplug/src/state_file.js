// SPDX-License-Identifier: Apache-2.0
// The edge node remembers its birth-death number, the last event, and each client's last event.
import {closeSync, existsSync, fsyncSync, openSync, readFileSync, renameSync, writeSync} from 'node:fs';

export class StateFile {
  // Throws an Error when the file is there and is damaged.
  constructor(file) {
    this.file = file;
    this.bd_seq = -1;
    this.last_event_id = -1;
    this.devices = new Map();  // event by client
    if (!existsSync(file)) return;
    try {
      const {bd_seq, last_event_id, devices} = JSON.parse(readFileSync(file, 'utf8'));
      if (!Number.isInteger(bd_seq) || !Number.isInteger(last_event_id)) throw new Error('numbers are missing');
      Object.assign(this, {bd_seq, last_event_id, devices: new Map(devices)});
    } catch (error) {
      throw new Error(`${file}: is damaged (${error.message}); remove it to begin anew`);
    }
  }

  // Replaced as a whole: a kill leaves the old file or the new one.
  save(is_synced) {
    const {bd_seq, last_event_id, devices} = this;
    const descriptor = openSync(`${this.file}.new`, 'w', 0o600);
    try {
      writeSync(descriptor, JSON.stringify({bd_seq, last_event_id, devices: [...devices]}));
      if (is_synced) fsyncSync(descriptor);
    } finally {
      closeSync(descriptor);
    }
    renameSync(`${this.file}.new`, this.file);
  }

  // The number of the next connection, 0 to 255.
  nextBirth() {
    this.bd_seq = (this.bd_seq + 1) % 256;
    this.save(true);
    return this.bd_seq;
  }

  isNew(event) {
    return Number(event.event_id) > this.last_event_id;
  }

  note(event) {
    this.last_event_id = Number(event.event_id);
    this.devices.set(event.job.client, event);
    this.save(false);
  }
}

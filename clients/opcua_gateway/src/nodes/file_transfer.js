// SPDX-License-Identifier: Apache-2.0
// Files of TemporaryFileTransferType (OPC 10000-20): an object of FileType for each transfer, which
// only the session that asked for it can use, and which is removed when it is closed or has not been
// used for a while.
import {randomUUID} from 'node:crypto';
import {openSync, closeSync, fstatSync, fsyncSync, readSync, rmSync} from 'node:fs';
import path from 'node:path';
import opcua from 'node-opcua';
import {freeBytes, FULL_DISK_CODES, writeAll} from '../orders/disk.js';
import {MethodRefusal} from './vision_system.js';

const {DataType, StatusCodes, VariantArrayType} = opcua;
export const IDLE_TIMEOUT_MS = 120_000;
const MAX_TRANSFERS = 32;
const MAX_FILE_BYTES = 4 * 2 ** 30;
const MAX_BLOCK_BYTES = 1 << 20;

const good = (...outputArguments) => ({statusCode: StatusCodes.Good, outputArguments});
const refused = (statusCode) => ({statusCode});

export class FileTransfers {
  // `min_free_bytes`: files leave so much room on the disk, which the ledger needs.
  constructor(address_space, parent, folder, min_free_bytes) {
    this.min_free_bytes = min_free_bytes;
    this.fetching = 0;  // results on their way here
    this.address_space = address_space;
    this.parent = parent;  // object below which the files appear
    this.folder = folder;
    this.transfers = new Map();  // by handle
    this.next_handle = 1;
    this.timer = setInterval(() => this.closeIdle(), 10_000);
    this.timer.unref();
  }

  hasRoom(bytes) {
    return freeBytes(this.folder) - bytes >= this.min_free_bytes;
  }

  // Throws a MethodRefusal when `bytes` have no room on the disk.
  checkRoom(bytes) {
    if (!this.hasRoom(bytes)) throw new MethodRefusal(StatusCodes.BadResourceUnavailable, 'the disk of the gateway is full');
  }

  checkCount() {
    if (this.transfers.size + this.fetching >= MAX_TRANSFERS) {
      throw new MethodRefusal(StatusCodes.BadResourceUnavailable, `${MAX_TRANSFERS} files are open; close some`);
    }
  }

  newPath() {
    return path.join(this.folder, `transfer-${randomUUID()}`);
  }

  // A new, empty file of the session.
  openForWrite(session, about) {
    this.checkCount();
    this.checkRoom(0);
    return this.open(session, this.newPath(), true, about);
  }

  // A file of `bytes` that `fetch(path)` saves.
  async openForRead(session, bytes, fetch) {
    this.checkCount();
    this.checkRoom(bytes);
    this.fetching++;
    const file = this.newPath();
    try {
      await fetch(file);
      return this.open(session, file, false, {});
    } catch (error) {
      rmSync(file, {force: true});
      throw error;
    } finally {
      this.fetching--;
    }
  }

  open(session, file, is_writable, about) {
    const descriptor = openSync(file, is_writable ? 'w+' : 'r', 0o600);
    const handle = this.next_handle++;
    const type = this.address_space.findObjectType('FileType');
    const namespace = this.parent.namespace;
    const node = type.instantiate({browseName: {name: `Transfer${handle}`, namespaceIndex: namespace.index}, namespace, componentOf: this.parent});
    const transfer = {handle, session, file, is_writable, about, node, position: 0, descriptor, used: Date.now()};
    const set = (name, dataType, value) => node.getPropertyByName(name).setValueFromSource(
        {dataType, arrayType: VariantArrayType.Scalar, value});
    set('Size', DataType.UInt64, [0, fstatSync(transfer.descriptor).size]);
    set('Writable', DataType.Boolean, is_writable);
    set('UserWritable', DataType.Boolean, is_writable);
    set('OpenCount', DataType.UInt16, 1);
    const bind = (name, action) => node.getMethodByName(name).bindMethod((inputs, context, callback) => {
      if (context.session !== session || inputs[0].value !== handle || !this.transfers.has(handle)) {
        callback(null, refused(StatusCodes.BadInvalidArgument));
        return;
      }
      transfer.used = Date.now();
      callback(null, action(transfer, inputs));
    });
    bind('Read', (t, inputs) => this.read(t, inputs[1].value));
    bind('Write', (t, inputs) => this.writeBlock(t, inputs[1].value));
    bind('GetPosition', (t) => good({dataType: DataType.UInt64, arrayType: VariantArrayType.Scalar, value: [0, t.position]}));
    bind('SetPosition', (t, inputs) => {
      t.position = Math.min(inputs[1].value[0] * 2 ** 32 + inputs[1].value[1], fstatSync(t.descriptor).size);
      return good();
    });
    bind('Close', (t) => {
      this.close(t);
      return good();
    });
    node.getMethodByName('Open').bindMethod((inputs, context, callback) =>
      callback(null, refused(StatusCodes.BadNotWritable)));
    this.transfers.set(handle, transfer);
    return transfer;
  }

  read(transfer, length) {
    if (transfer.is_writable) return refused(StatusCodes.BadInvalidState);
    if (length <= 0) return refused(StatusCodes.BadInvalidArgument);
    const block = Buffer.alloc(Math.min(length, MAX_BLOCK_BYTES));
    const bytes = readSync(transfer.descriptor, block, 0, block.length, transfer.position);
    transfer.position += bytes;
    return good({dataType: DataType.ByteString, value: block.subarray(0, bytes)});
  }

  writeBlock(transfer, block) {
    if (!transfer.is_writable) return refused(StatusCodes.BadInvalidState);
    if (transfer.position + (block?.length ?? 0) > MAX_FILE_BYTES) return refused(StatusCodes.BadOutOfRange);
    if (!block?.length) return good();
    if (!this.hasRoom(block.length)) return refused(StatusCodes.BadResourceUnavailable);
    try {
      writeAll(transfer.descriptor, block, transfer.position);
    } catch (error) {
      if (!FULL_DISK_CODES.includes(error.code)) return refused(StatusCodes.BadUnexpectedError);
      this.close(transfer);  // its part of the file would keep the disk full
      return refused(StatusCodes.BadResourceUnavailable);
    }
    transfer.position += block.length;
    return good();
  }

  // The session's own transfer of that handle, if there is one.
  find(session, handle) {
    const transfer = this.transfers.get(handle);
    return transfer?.session === session ? transfer : undefined;
  }

  // Ends a transfer; its file is removed unless `keep`.
  close(transfer, keep = false) {
    if (!this.transfers.delete(transfer.handle)) return;
    if (keep) fsyncSync(transfer.descriptor);
    closeSync(transfer.descriptor);
    if (!keep) rmSync(transfer.file, {force: true});
    setImmediate(() => this.address_space.deleteNode(transfer.node));
  }

  closeIdle() {
    for (const transfer of this.transfers.values()) {
      if (Date.now() - transfer.used > IDLE_TIMEOUT_MS) this.close(transfer);
    }
  }

  closeOf(session) {
    for (const transfer of this.transfers.values()) if (transfer.session === session) this.close(transfer);
  }

  closeAll() {
    clearInterval(this.timer);
    for (const transfer of this.transfers.values()) this.close(transfer);
  }
}

// SPDX-License-Identifier: Apache-2.0
// Writing to a disk that may be full.
import {closeSync, fsyncSync, openSync, statfsSync, writeSync} from 'node:fs';

// Codes of the operating system for a disk that takes no more.
export const FULL_DISK_CODES = ['ENOSPC', 'EDQUOT', 'EFBIG'];

// Writes all bytes behind the last ones, or at `position`: one call of the operating system may
// write fewer when the disk fills up. Throws the error of the call that writes none.
export function writeAll(descriptor, bytes, position = null) {
  for (let done = 0; done < bytes.length;) {
    done += writeSync(descriptor, bytes, done, bytes.length - done, position === null ? null : position + done);
  }
}

// Makes a rename in the folder survive a loss of power.
export function syncFolder(folder) {
  const descriptor = openSync(folder, 'r');
  try {
    fsyncSync(descriptor);
  } finally {
    closeSync(descriptor);
  }
}

// Bytes that a user other than root can still write below the folder.
export function freeBytes(folder) {
  const {bavail, bsize} = statfsSync(folder);
  return bavail * bsize;
}

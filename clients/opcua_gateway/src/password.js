// SPDX-License-Identifier: Apache-2.0
// Passwords as the configuration has them: scrypt:SALT:HASH.
import {randomBytes, scrypt, scryptSync, timingSafeEqual} from 'node:crypto';
import {promisify} from 'node:util';

const HASH_BYTES = 32;
const FORM = /^scrypt:[0-9a-f]{32}:[0-9a-f]{64}$/;
const derive = promisify(scrypt);

export function hashPassword(password) {
  const salt = randomBytes(16).toString('hex');
  return `scrypt:${salt}:${scryptSync(password, salt, HASH_BYTES).toString('hex')}`;
}

export const isPasswordHash = (text) => FORM.test(text);

// The check runs in a thread of its own, so that many logins do not stop other sessions.
export async function isPassword(password, stored) {
  const [, salt, hash] = stored.split(':');
  return timingSafeEqual(await derive(password, salt, HASH_BYTES), Buffer.from(hash, 'hex'));
}

// SPDX-License-Identifier: Apache-2.0
// Requests to the explorer's server.

/** An answer other than 2xx: `reason` and `fields` as the server says. */
export class ServerError extends Error {
  constructor(error, status) {
    super(error?.message ?? `the server answered ${status}`);
    this.reason = error?.reason ?? '';
    this.fields = error?.fields ?? [];
  }
}

async function answer(response) {
  const body = await response.json().catch(() => null);
  if (!response.ok) throw new ServerError(body?.error, response.status);
  return body;
}

async function reach(path, options) {
  try {
    return await fetch(path, options);
  } catch (error) {
    if (error.name === 'AbortError') throw error;
    throw new ServerError({reason: 'NO_SERVER', message: 'The server does not answer. Has `sightline explore` ended?'});
  }
}

export const get = async (path) => answer(await reach(path));

export const post = async (path, body = {}) => answer(await reach(path, {
  method: 'POST', headers: {'Content-Type': 'application/json'}, body: JSON.stringify(body),
}));

// SPDX-License-Identifier: Apache-2.0
// Events of the planning service (docs/clients.md, "Events by MQTT") as metrics. Pure functions.

export const REBIRTH = 'Node Control/Rebirth';
export const CANCEL = 'Device Control/Cancel';

// Name, type and value of each metric of a device. A device is a client of the service; its metrics
// are those of its job that changed last.
const JOB_METRICS = [
  ['Job/Event Id', 'UInt64', ({event_id}) => Number(event_id)],
  ['Job/Event', 'String', ({type}) => type],
  ['Job/Id', 'String', ({job}) => job.job_id],
  ['Job/Request Id', 'String', ({job}) => job.request_id ?? ''],
  ['Job/Kind', 'String', ({job}) => job.kind],
  ['Job/State', 'String', ({job}) => job.state],
  ['Job/Progress', 'Double', ({job}) => job.progress ?? 0],
  ['Job/Message', 'String', ({job}) => job.message ?? ''],
  ['Job/Failure', 'String', ({job}) => job.failure ? `${job.failure.reason || job.failure.code}: ${job.failure.message}` : ''],
];

// The event in a message of the service. Throws an Error with the reason when it is none.
export function parseEvent(bytes) {
  const event = JSON.parse(bytes.toString('utf8'));
  if (!/^[0-9]{1,15}$/.test(event?.event_id)) throw new Error('event_id: must be a number as a string');
  if (typeof event.type !== 'string') throw new Error('type: must be a string');
  if (Number.isNaN(Date.parse(event.time))) throw new Error('time: must be a time');
  for (const field of ['job_id', 'kind', 'state', 'client']) {
    if (typeof event.job?.[field] !== 'string') throw new Error(`job.${field}: must be a string`);
  }
  return event;
}

// Client names may have characters that are no part of a topic (MQTT 3.1.1, 4.7); "%" keeps them apart.
export const deviceId = (client) => client.replace(/[%/+#\0]/g, (c) => `%${c.charCodeAt(0).toString(16).padStart(2, '0')}`);

// `event` null: a device of which nothing is known.
export function jobMetrics(event) {
  const timestamp = event ? Date.parse(event.time) : undefined;
  return JOB_METRICS.map(([name, type, value]) => ({name, type, timestamp, value: event ? value(event) : null}));
}

// Metrics of a DBIRTH: those of the job, and the command that the device takes.
export const deviceBirth = (event) => [...jobMetrics(event), {name: CANCEL, type: 'String', value: ''}];

export const nodeBirth = (bd_seq, is_online) => [
  {name: 'bdSeq', type: 'Int64', value: bd_seq},
  {name: REBIRTH, type: 'Boolean', value: false},
  {name: 'Service/Online', type: 'Boolean', value: is_online},
];

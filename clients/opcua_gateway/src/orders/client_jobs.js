// SPDX-License-Identifier: Apache-2.0
// Orders of one client: starts them at the planning service, follows them to their end, and notes an
// event for each step. Everything is asked again after a restart of either side, and the ledger makes
// it the same order and the same event.
import grpc from '@grpc/grpc-js';

const POLL_MS = 400;
// Only these end an order: INVALID_ARGUMENT, NOT_FOUND, ALREADY_EXISTS, PERMISSION_DENIED. A call that
// breaks with the service's process has any other code, and is made again.
const FINAL_CODES = [grpc.status.INVALID_ARGUMENT, grpc.status.NOT_FOUND, grpc.status.ALREADY_EXISTS, grpc.status.PERMISSION_DENIED];
// A new order is refused for these as well: its caller gets the reason.
const REFUSAL_CODES = [...FINAL_CODES, grpc.status.RESOURCE_EXHAUSTED, grpc.status.FAILED_PRECONDITION, grpc.status.UNAUTHENTICATED];
// An order that was refused may be given again.
const NEW_ORDER = {refusal: null, is_closed: false, is_cancelled: false, is_started: false, is_answered: false, job_id: null};
const FINISHED = ['SUCCEEDED', 'FAILED', 'CANCELLED'];
// ResultState of OPC 40001-101: 1 completed, 3 aborted, 4 failed.
export const RESULT_STATES = {SUCCEEDED: 1, CANCELLED: 3, FAILED: 4};

export class ClientJobs {
  // `on_state(observed)`: what the service's state machine says, at every look. `on_events()`: the
  // ledger has new ones.
  constructor(service, ledger, {on_state, on_events}) {
    Object.assign(this, {service, ledger, on_state, on_events});
    this.is_stopped = false;
    this.pending = null;
    this.undecided = new Map();  // by request id: orders that the service has not answered yet
  }

  run() {
    this.running = this.loop();
  }

  async loop() {
    while (!this.is_stopped) {
      await this.look().then(() => this.report(''), (error) => this.report(`following jobs: ${error.message}`));
      await new Promise((resolve) => {
        this.wake = resolve;
        this.timer = setTimeout(resolve, POLL_MS);
      });
      clearTimeout(this.timer);
    }
  }

  // Every look at the same trouble would say the same.
  report(trouble) {
    if (trouble && trouble !== this.reported) console.error(trouble);
    this.reported = trouble;
  }

  async stop() {
    this.is_stopped = true;
    this.wake?.();
    await this.running;
  }

  openOrders() {
    return [...this.ledger.orders.values()].filter((order) => !order.is_closed);
  }

  // An accepted order is not finished: the state machine is in SingleExecution, even while the service
  // works on other clients' jobs before it or has not taken it yet.
  isBusy() {
    return this.openOrders().some((order) => order.job_id || order.is_answered);
  }

  // One look at the service: orders first, so that a job's end is noted before the state changes, and
  // events last, so that they find the state changed. Looks that are asked for meanwhile wait for
  // this one.
  look() {
    this.pending ??= this.lookNow().finally(() => {
      this.pending = null;
    });
    return this.pending;
  }

  async lookNow() {
    for (const order of this.openOrders()) {
      if (this.is_stopped) return;
      if (!(await this.advance(order))) break;
    }
    this.on_state(await this.service.visionState());
    this.on_events();
  }

  // False: the service is away.
  async advance(order) {
    try {
      let job = order.job_id ? (await this.service.call('GetPlanningJob', {job_id: order.job_id})).job :
          await this.ask(order);
      if (order.is_cancelled && !FINISHED.includes(job.state)) {
        job = (await this.service.call('CancelPlanningJob', {job_id: job.job_id})).job;
      }
      this.note(order, job);
    } catch (error) {
      if (!FINAL_CODES.includes(error.code)) return false;
      this.refuse(order, error);
    }
    return true;
  }

  async ask(order) {
    return (await this.service.call('StartJob',
        {request_id: order.request_id, recipe_id: order.external_recipe_id, priority: 0})).job;
  }

  // An order that the service does not take, or whose job is gone. One that was answered as
  // accepted ends with events of its own; one whose caller gets the error has none.
  refuse(order, error) {
    const was_accepted = order.job_id || order.is_answered;
    const events = was_accepted ? [
      {type: 'Error', request_id: order.request_id, message: error.details ?? error.message},
      {type: 'ResultReady', request_id: order.request_id, result_state: RESULT_STATES.FAILED},
      {type: 'Ready', request_id: order.request_id}] : [];
    this.ledger.write({order: {request_id: order.request_id, is_closed: true, refusal: error.details ?? error.message}, events});
  }

  note(order, job) {
    const events = [];
    const change = {request_id: order.request_id, job_id: job.job_id};
    const is_finished = FINISHED.includes(job.state);
    if (!order.is_started && (job.state === 'RUNNING' || is_finished)) {
      change.is_started = true;
      events.push({type: 'JobStarted', request_id: order.request_id});
    }
    if (is_finished) {
      change.is_closed = true;
      change.job = job;
      if (job.state === 'FAILED') {
        const {reason, code, message} = job.failure ?? {};
        events.push({type: 'Error', request_id: order.request_id, message: `${reason || code}: ${message}`});
      }
      events.push({type: 'ResultReady', request_id: order.request_id, result_state: RESULT_STATES[job.state]});
      events.push({type: 'Ready', request_id: order.request_id});
    }
    if (events.length === 0 && order.job_id === job.job_id) return;
    this.ledger.write({order: change, events});
  }

  // Notes the order, then starts it. The same request id again is the same order. Returns the order;
  // throws the service's error if it does not take it. When the service is away the order stays and
  // is asked for again: the caller gets it as accepted.
  // The same request id while the first call is undecided gets that call's outcome.
  start(order) {
    const id = order.request_id;
    if (!this.undecided.has(id)) {
      this.undecided.set(id, this.startNow(order).finally(() => this.undecided.delete(id)));
    }
    return this.undecided.get(id);
  }

  async startNow(order) {
    const known = this.ledger.orders.get(order.request_id);
    if (known && !known.refusal) return known;
    this.ledger.write({order: {...NEW_ORDER, ...order}});
    const kept = this.ledger.orders.get(order.request_id);
    try {
      this.note(kept, await this.ask(kept));
      this.on_events();
    } catch (error) {
      if (REFUSAL_CODES.includes(error.code)) {
        this.refuse(kept, error);
        throw error;
      }
      this.ledger.write({order: {request_id: order.request_id, is_answered: true}});
    }
    return this.ledger.orders.get(order.request_id);
  }

  // Cancels what is not finished. It is noted first: an order that the service has not taken yet, or
  // whose cancellation it does not hear, is cancelled as soon as it answers.
  async cancelAll() {
    for (const order of this.openOrders()) {
      this.ledger.write({order: {request_id: order.request_id, is_cancelled: true}});
    }
    await this.look();
    // A look that was under way may have passed the order before.
    await this.look();
  }
}

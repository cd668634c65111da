// SPDX-License-Identifier: Apache-2.0
// The VisionSystem object of one client: state machine, events, and the rights to its methods.
import opcua from 'node-opcua';
import {ClientJobs} from '../orders/client_jobs.js';
import {FULL_DISK_CODES} from '../orders/disk.js';
import {follow, OPERATIONAL_STATES, topState} from '../orders/vision_states.js';

const {DataType, StatusCodes, LocalizedText, NodeId} = opcua;
export const MACHINE_VISION = 'http://opcfoundation.org/UA/MachineVision';
export const GATEWAY = 'urn:sightline:opcua-gateway';

const OPTIONALS = ['ConfigurationManagement', 'RecipeManagement', 'RecipeManagement.AddRecipe',
  'RecipeManagement.RemoveRecipe', 'RecipeManagement.RecipeTransfer', 'ResultManagement',
  'ResultManagement.ResultTransfer', 'ResultManagement.ReleaseResultHandle', 'VisionStateMachine.AutomaticModeStateMachine',
  'VisionStateMachine.AutomaticModeStateMachine.SimulationMode'];
const EVENT_TYPES = {JobStarted: 'JobStartedEventType', Ready: 'ReadyEventType', ResultReady: 'ResultReadyEventType',
  Error: 'ErrorEventType', RecipePrepared: 'RecipePreparedEventType'};
const SEVERITY = {Error: 700};
// Events that one call of RepeatEvents raises: fewer than the smallest queue that clients usually ask for.
const MAX_REPEATED = 500;

// Status code for an error of the service: docs/errors-and-limits.md by gRPC code.
const STATUS_BY_CODE = {
  3: StatusCodes.BadInvalidArgument, 4: StatusCodes.BadTimeout, 5: StatusCodes.BadNotFound, 6: StatusCodes.BadEntryExists,
  7: StatusCodes.BadUserAccessDenied, 8: StatusCodes.BadResourceUnavailable, 9: StatusCodes.BadInvalidState,
  14: StatusCodes.BadNoCommunication, 16: StatusCodes.BadUserAccessDenied,
};

// Status code for the error of an action: of the service, of the gateway's disk, or a refusal.
function statusOf(error) {
  if (FULL_DISK_CODES.includes(error.code)) return StatusCodes.BadResourceUnavailable;
  return error.status ?? STATUS_BY_CODE[error.code] ?? StatusCodes.BadInternalError;
}

// An error of a method: a status code and the reason in words.
export class MethodRefusal extends Error {
  constructor(status, reason) {
    super(reason);
    this.status = status;
  }
}

export class VisionSystem {
  constructor(address_space, name, {service, ledger, users}) {
    Object.assign(this, {address_space, name, service, ledger, users});
    this.index = address_space.getNamespaceIndex(MACHINE_VISION);
    const own = address_space.getNamespace(GATEWAY);
    this.node = address_space.findObjectType('VisionSystemType', this.index).instantiate({
      browseName: {name, namespaceIndex: own.index}, displayName: name, nodeId: `ns=${own.index};s=${name}`, namespace: own,
      organizedBy: address_space.rootFolder.objects, optionals: OPTIONALS});
    this.node.setEventNotifier(1);
    this.private_nodes = new Set([this.node]);
    this.machine = this.child('VisionStateMachine');
    this.automatic = this.child('VisionStateMachine', 'AutomaticModeStateMachine');
    this.last_refusal = own.addVariable({propertyOf: this.node, browseName: 'LastRefusal', dataType: 'String', accessLevel: 'CurrentRead',
      userAccessLevel: 'CurrentRead', nodeId: `ns=${own.index};s=${name}.LastRefusal`, value: {dataType: DataType.String, value: ''}});
    // Reasons name recipes and jobs, which are the client's own.
    this.keepPrivate(this.last_refusal);
    this.state = 'Preoperational';
    this.has_new_error = false;
    this.raised_number = ledger.raised_number;
    this.observers = [];  // functions that show state and orders at other nodes
    this.showState();
    this.jobs = new ClientJobs(service, ledger, {
      on_state: (observed) => this.observe(observed), on_events: () => this.raiseWaiting()});
    // Events wait until somebody listens.
    this.node.on('newListener', (event) => {
      if (event === 'event') setTimeout(() => this.raiseWaiting(), 100);
    });
  }

  child(...names) {
    return names.reduce((node, name) => node.getChildByName(name), this.node);
  }

  structure(name, fields) {
    return this.address_space.constructExtensionObject(this.address_space.findDataType(name, this.index), fields);
  }

  isOwn(session) {
    return this.users.clientOf(session) === this.name;
  }

  // Sessions of this client alone can read the variable, and monitor it (see guard).
  keepPrivate(variable) {
    this.private_nodes.add(variable);
    const isUserReadable = variable.isUserReadable.bind(variable);
    variable.isUserReadable = (context) => isUserReadable(context) && (!context?.session || this.isOwn(context.session));
  }

  // `action(inputs, session)` gives the output values, in order, or throws; a value is a Variant's
  // options. Only sessions of this client get through.
  bind(path, action) {
    const method = this.child(...path);
    method.bindMethod(async (inputs, context, callback) => {
      if (!this.isOwn(context.session)) {
        callback(null, {statusCode: StatusCodes.BadUserAccessDenied});
        return;
      }
      try {
        const outputs = await action(inputs.map((input) => input.value), context.session);
        callback(null, {statusCode: StatusCodes.Good, outputArguments: outputs ?? []});
      } catch (error) {
        const status = statusOf(error);
        const reason = `${path.at(-1)}: ${error.details ?? error.message}`;
        this.last_refusal.setValueFromSource({dataType: DataType.String, value: reason});
        console.error(`${this.name}: ${reason} (${status.name})`);
        callback(null, {statusCode: status});
      }
    });
  }

  refuse(path, status, reason) {
    this.bind(path, () => {
      throw new MethodRefusal(status, reason);
    });
  }

  // `show()` is called now, and whenever state or orders may have changed.
  onObserved(show) {
    this.observers.push(show);
    show();
  }

  // Follows what the service says; `cause` is the method that made the change.
  observe(observed, cause) {
    const is_operational = ['INITIALIZED', 'READY'].includes(observed);
    for (const step of follow(this.state, is_operational && this.jobs.isBusy() ? 'SINGLE_EXECUTION' : observed, cause)) {
      this.state = step.state;
      this.has_new_error ||= step.state === 'Error';
    }
    this.showState();
    // Tried again at the next look when the gateway's own disk is full.
    this.tryToWrite(() => {
      if (this.has_new_error) this.ledger.write({events: [{type: 'Error', message: 'DISK_FULL: the service takes no jobs'}]});
      this.has_new_error = false;
    });
    for (const show of this.observers) show();
    this.raiseWaiting();
  }

  tryToWrite(action) {
    try {
      action();
    } catch (error) {
      console.error(`${this.name}: ${error.message}`);
    }
  }

  showState() {
    const show = (machine, type, name) => {
      const current = machine.getChildByName('CurrentState');
      const state = name ? this.address_space.findObjectType(type, this.index).getChildByName(name) : null;
      current.setValueFromSource({dataType: DataType.LocalizedText, value: new LocalizedText(name ?? '')},
          name ? StatusCodes.Good : StatusCodes.BadStateNotActive);
      current.getChildByName('Id').setValueFromSource(
          {dataType: DataType.NodeId, value: state?.nodeId ?? NodeId.nullNodeId},
          name ? StatusCodes.Good : StatusCodes.BadStateNotActive);
    };
    show(this.machine, 'VisionStateMachineType', topState(this.state));
    show(this.automatic, 'VisionAutomaticModeStateMachineType', OPERATIONAL_STATES.includes(this.state) ? this.state : null);
  }

  // Raises events that nobody has got yet, while there is a listener.
  raiseWaiting() {
    if (this.node.listenerCount('event') === 0) return;
    const waiting = this.ledger.events.filter((event) => event.number > this.raised_number);
    if (waiting.length === 0) return;
    for (const event of waiting) this.raise(event);
    this.raised_number = waiting.at(-1).number;
    // Without this line a restart raises them again, with the same EventIds.
    this.tryToWrite(() => this.ledger.write({raised_number: this.raised_number}));
  }

  // Raises again the next events with greater numbers. Returns the number of the last one.
  repeat(after) {
    const next = this.ledger.events.filter((event) => event.number > after).slice(0, MAX_REPEATED);
    for (const event of next) this.raise(event);
    return next.at(-1)?.number ?? after;
  }

  // On this object alone, not on Server: events are the client's own.
  raise(event) {
    const type = this.address_space.findEventType(EVENT_TYPES[event.type], this.index);
    const order = this.ledger.orders.get(event.request_id);
    const text = (value) => ({dataType: DataType.LocalizedText, value: new LocalizedText(value)});
    const data = this.address_space.constructEventData(type, {
      $eventDataSource: type, sourceNode: {dataType: DataType.NodeId, value: this.node.nodeId},
      message: text(event.message ?? event.type), severity: {dataType: DataType.UInt16, value: SEVERITY[event.type] ?? 100},
      time: {dataType: DataType.DateTime, value: new Date(event.time)}, ...this.eventFields(event, order)});
    // The library makes an id of its own; ours is the same however often the event is raised.
    data.eventId.value = this.ledger.eventId(event.number);
    this.node.emit('event', data);
  }

  eventFields(event, order) {
    const fields = {};
    const structure = (name, type, value) => {
      fields[name] = {dataType: DataType.ExtensionObject, value: this.structure(type, value)};
    };
    if (event.type === 'RecipePrepared') {
      structure('internalId', 'RecipeIdInternalDataType', {id: event.internal_id});
      structure('externalId', 'RecipeIdExternalDataType', {id: event.external_id});
    }
    if (['JobStarted', 'Ready', 'ResultReady'].includes(event.type)) structure('jobId', 'JobIdDataType', {id: event.request_id});
    if (event.type === 'ResultReady' && order) {
      structure('resultId', 'ResultIdDataType', {id: order.job_id});
      structure('measId', 'MeasIdDataType', {id: order.meas_id});
      structure('partId', 'PartIdDataType', {id: order.part_id});
      structure('productId', 'ProductIdDataType', {id: order.product_id});
      structure('externalRecipeId', 'RecipeIdExternalDataType', {id: order.external_recipe_id});
      structure('internalRecipeId', 'RecipeIdInternalDataType', {id: order.internal_recipe_id});
      structure('internalConfigurationId', 'ConfigurationIdDataType', {id: 'service'});
      fields.isPartial = {dataType: DataType.Boolean, value: false};
      fields.isSimulated = {dataType: DataType.Boolean, value: false};
      fields.resultState = {dataType: DataType.Int32, value: event.result_state};
      fields.creationTime = {dataType: DataType.DateTime, value: new Date(event.time)};
    }
    return fields;
  }

  // Closes the monitored items of other clients' sessions on this system's events and private variables. The
  // library asks for the right to read only when it samples, not when a value changes.
  guard(session, subscription, item) {
    if (!this.private_nodes.has(item.node) || this.isOwn(session)) return;
    setImmediate(() => subscription.removeMonitoredItem(item.monitoredItemId));
  }
}

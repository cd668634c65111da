// SPDX-License-Identifier: Apache-2.0
// JobManagement of OPC UA for Machinery (OPC 40001-3) on the same orders as StartSingleJob: the
// JobOrderID is the MeasId, and the ID of the work master is the recipe's ExternalId.
import opcua from 'node-opcua';
import {dateOf, idOf, order as orderJob} from './job_methods.js';
import {addIn} from './machinery.js';
import {MethodRefusal} from './vision_system.js';

const {coerceLocalizedText, DataType, StatusCodes, VariantArrayType} = opcua;
const JOBS = 'http://opcfoundation.org/UA/Machinery/Jobs/';
const JOB_CONTROL = 'http://opcfoundation.org/UA/ISA95-JOBCONTROL_V2/';
const CONTROL = ['MachineryBuildingBlocks', 'JobManagement', 'JobOrderControl'];
const RESULTS = ['MachineryBuildingBlocks', 'JobManagement', 'JobOrderResults'];
const METHODS = ['StoreAndStart', 'Abort'];
// Newest orders in JobOrderList; responses are kept as long as the ledger keeps the order.
const MAX_LISTED = 100;
// ReturnStatus of OPC 10031-4, annex B.2: bit 0 says that there is no error. A refused call has a bad
// status code, and therefore no ReturnStatus.
const RETURN_NO_ERROR = {dataType: DataType.UInt64, arrayType: VariantArrayType.Scalar, value: [0, 1]};
// StateNumber of ISA95JobOrderReceiverObjectType.
const STATE_NUMBERS = {AllowedToStart: 2, Running: 3, Ended: 5, Aborted: 6};
const JOB_RESULT = {Unknown: 0, Successful: 1, Unsuccessful: 2};

// Orders whose caller got a refusal never were job orders.
const wasAccepted = (order) => !order.refusal || order.job_id || order.is_answered;

export function jobOrderState(order) {
  if (order.refusal) return 'Aborted';
  if (order.job) return order.job.state === 'CANCELLED' ? 'Aborted' : 'Ended';
  return order.is_started ? 'Running' : 'AllowedToStart';
}

function jobResult({job, refusal}) {
  if (!job) return refusal ? JOB_RESULT.Unsuccessful : JOB_RESULT.Unknown;
  return job.state === 'SUCCEEDED' ? JOB_RESULT.Successful : JOB_RESULT.Unsuccessful;
}

class JobManagement {
  constructor(system) {
    this.system = system;
    this.index = system.address_space.getNamespaceIndex(JOB_CONTROL);
  }

  structure(type, fields) {
    const {address_space} = this.system;
    return address_space.constructExtensionObject(address_space.findDataType(type, this.index), fields);
  }

  // The state, and the path to it from the receiver.
  state(order) {
    const name = jobOrderState(order);
    const path = {elements: [{referenceTypeId: 'ns=0;i=47', isInverse: false, includeSubtypes: true,
      targetName: {namespaceIndex: this.index, name}}]};
    return [this.structure('ISA95StateDataType', {browsePath: path, stateText: coerceLocalizedText(name), stateNumber: STATE_NUMBERS[name]})];
  }

  listed() {
    return [...this.system.ledger.orders.values()].filter(wasAccepted).slice(-MAX_LISTED);
  }

  jobOrder(order) {
    return this.structure('ISA95JobOrderAndStateDataType', {state: this.state(order),
      jobOrder: {jobOrderID: order.request_id, workMasterID: [{ID: order.external_recipe_id}]}});
  }

  response(order) {
    const {job} = order;
    return this.structure('ISA95JobResponseDataType', {jobResponseID: order.job_id ?? '', jobOrderID: order.request_id,
      startTime: dateOf(job?.started_at), endTime: dateOf(job?.finished_at), jobState: this.state(order),
      jobResponseData: [{ID: 'JobResult', value: {dataType: DataType.Int32, value: jobResult(order)}}]});
  }

  async storeAndStart([job_order]) {
    const id = job_order?.jobOrderID ?? '';
    if (id === '') throw new MethodRefusal(StatusCodes.BadInvalidArgument, 'JobOrderID: must have 1 to 128 bytes');
    const masters = job_order.workMasterID ?? [];
    if (masters.length > 1) throw new MethodRefusal(StatusCodes.BadInvalidArgument, `WorkMasterID: has ${masters.length} entries, must have one`);
    await orderJob(this.system, {meas_id: idOf({id}, 'JobOrderID'), part_id: '', product_id: '',
      external_id: idOf({id: masters[0]?.ID ?? ''}, 'WorkMasterID')}, 'JobOrderID');
    return [RETURN_NO_ERROR];
  }

  find(id) {
    const order = this.system.ledger.orders.get(id ?? '');
    if (!order || !wasAccepted(order)) throw new MethodRefusal(StatusCodes.BadNotFound, `JobOrderID ${id}: is unknown`);
    return order;
  }

  async abort([id]) {
    const order = this.find(id);
    if (order.is_closed) {
      throw new MethodRefusal(StatusCodes.BadInvalidState, `JobOrderID ${id}: its state is ${jobOrderState(order)}, must be AllowedToStart or Running`);
    }
    await this.system.jobs.cancelAll();
    this.system.observe(await this.system.service.visionState(), 'Abort');
    return [RETURN_NO_ERROR];
  }

  byId([id]) {
    const value = this.response(this.find(id));
    return [{dataType: DataType.ExtensionObject, value}, RETURN_NO_ERROR];
  }

  // All orders of the list in the state, or one of its sub-states: there are none.
  byState([states]) {
    const numbers = new Set((states ?? []).map((state) => state.stateNumber));
    const value = this.listed().filter((order) => numbers.has(STATE_NUMBERS[jobOrderState(order)])).map((order) => this.response(order));
    return [{dataType: DataType.ExtensionObject, arrayType: VariantArrayType.Array, value}, RETURN_NO_ERROR];
  }

  recipes() {
    const names = [...this.system.ledger.recipes.values()].filter((recipe) => recipe.prepared).map((recipe) => recipe.external_id);
    return names.map((ID) => this.structure('ISA95WorkMasterDataType', {ID}));
  }
}

// A list that follows the ledger; `key` is a text that differs when the list does.
function follow(system, variable, key, list) {
  let shown;
  system.keepPrivate(variable);
  system.onObserved(() => {
    const now = key();
    if (now === shown) return;
    variable.setValueFromSource({dataType: DataType.ExtensionObject, arrayType: VariantArrayType.Array, value: list()});
    shown = now;
  });
}

export function addJobManagement(system, blocks) {
  addIn(system, blocks, [JOBS, 'JobManagementType'], METHODS.map((name) => `JobOrderControl.${name}`));
  const jobs = new JobManagement(system);
  const control = system.child(...CONTROL);
  // Each order has a state; the receiver as a whole has none.
  control.getChildByName('CurrentState').setValueFromSource({dataType: DataType.LocalizedText, value: null}, StatusCodes.BadStateNotActive);
  control.getPropertyByName('MaxDownloadableJobOrders').setValueFromSource({dataType: DataType.UInt16, value: 1});
  for (const name of ['EquipmentID', 'MaterialClassID', 'MaterialDefinitionID', 'PersonnelID', 'PhysicalAssetID']) {
    control.getChildByName(name).setValueFromSource({dataType: DataType.String, arrayType: VariantArrayType.Array, value: []});
  }
  follow(system, control.getChildByName('JobOrderList'),
      () => jobs.listed().map((order) => `${order.request_id} ${jobOrderState(order)}`).join('\n'),
      () => jobs.listed().map((order) => jobs.jobOrder(order)));
  follow(system, control.getChildByName('WorkMaster'), () => jobs.recipes().map((master) => master.ID).join('\n'), () => jobs.recipes());
  system.bind([...CONTROL, 'StoreAndStart'], (inputs) => jobs.storeAndStart(inputs));
  system.bind([...CONTROL, 'Abort'], (inputs) => jobs.abort(inputs));
  system.bind([...RESULTS, 'RequestJobResponseByJobOrderID'], (inputs) => jobs.byId(inputs));
  system.bind([...RESULTS, 'RequestJobResponseByJobOrderState'], (inputs) => jobs.byState(inputs));
}

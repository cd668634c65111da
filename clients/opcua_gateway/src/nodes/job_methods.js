// SPDX-License-Identifier: Apache-2.0
// Methods of the state machines: start, stop, reset.
import {randomUUID} from 'node:crypto';
import opcua from 'node-opcua';
import {MethodRefusal} from './vision_system.js';

const {DataType, StatusCodes, VariantArrayType} = opcua;
const MACHINE = ['VisionStateMachine'];
const AUTOMATIC = ['VisionStateMachine', 'AutomaticModeStateMachine'];
export const NO_ERROR = {dataType: DataType.Int32, value: 0};
const MAX_ID_BYTES = 128;
// Structures of the arguments. They all have one field, so that exchanged arguments would fit.
const STRUCTURES = {MeasId: 'MeasIdDataType', PartId: 'PartIdDataType', ProductId: 'ProductIdDataType', RecipeId: 'RecipeIdExternalDataType',
  ExternalId: 'RecipeIdExternalDataType', InternalId: 'RecipeIdInternalDataType'};

// The id of a structure such as MeasIdDataType; '' where there is none. `name` is the argument's.
export function idOf(structure, name = 'Id', max_bytes = MAX_ID_BYTES) {
  const type = structure?.schema?.name;
  if (type && STRUCTURES[name] && type !== STRUCTURES[name]) {
    throw new MethodRefusal(StatusCodes.BadTypeMismatch, `${name}: is a ${type}, must be a ${STRUCTURES[name]}`);
  }
  const id = structure?.id ?? '';
  if (Buffer.byteLength(id) > max_bytes) {
    throw new MethodRefusal(StatusCodes.BadInvalidArgument, `${name}: is longer than ${max_bytes} bytes`);
  }
  return id;
}

// The service's Timestamp as a Date; undefined where there is none.
export const dateOf = (stamp) => stamp ? new Date(Number(stamp.seconds) * 1000 + stamp.nanos / 1e6) : undefined;

// The prepared recipe of that external id; its newest one, as the service has one of a name.
export function preparedRecipe(system, external_id) {
  const found = [...system.ledger.recipes.values()].filter((r) => r.prepared && (external_id === '' || r.external_id === external_id));
  if (found.length === 0) {
    throw new MethodRefusal(StatusCodes.BadNotFound, `recipe ${external_id}: is not prepared`);
  }
  if (external_id === '' && found.length > 1) {
    throw new MethodRefusal(StatusCodes.BadInvalidArgument, 'RecipeId: several recipes are prepared, name one');
  }
  return found.at(-1);
}

// Throws where an order of that id was for something else: its result would look like that of the new one.
function checkSameOrder(system, known, {part_id, product_id, external_id}, name) {
  const differs = (what) => {
    throw new MethodRefusal(StatusCodes.BadEntryExists, `${name} ${known.request_id}: was used with another ${what}`);
  };
  if (external_id !== '' && known.external_recipe_id !== external_id) differs('recipe');
  if (known.part_id !== part_id) differs('PartId');
  if (known.product_id !== product_id) differs('ProductId');
  const recipe = [...system.ledger.recipes.values()].filter((r) => r.prepared && r.external_id === known.external_recipe_id).at(-1);
  if (recipe && known.recipe_digest && recipe.digest !== known.recipe_digest) differs('content of the recipe');
}

// Orders a job and returns its id, which is `meas_id` where there is one: the same again is the same job.
// `name` is what the caller calls that id.
export async function order(system, {meas_id, part_id, product_id, external_id}, name = 'MeasId') {
  const request_id = meas_id || randomUUID();
  const known = system.ledger.orders.get(request_id);
  if (known && !known.refusal) {
    checkSameOrder(system, known, {part_id, product_id, external_id}, name);
    await system.jobs.undecided.get(request_id);  // throws where the service refuses
    return request_id;
  }
  const recipe = preparedRecipe(system, external_id);
  if (system.state === 'Ready' && system.jobs.openOrders().length > 0) {
    throw new MethodRefusal(StatusCodes.BadInvalidState, 'another job is being started');
  }
  if (system.state !== 'Ready') {
    throw new MethodRefusal(StatusCodes.BadInvalidState, `the state is ${system.state}, must be Ready`);
  }
  await system.jobs.start({request_id, meas_id, part_id, product_id,
    external_recipe_id: recipe.external_id, internal_recipe_id: recipe.internal_id, recipe_digest: recipe.digest});
  if (system.state === 'Ready') system.observe('SINGLE_EXECUTION', 'StartSingleJob');
  return request_id;
}

async function startSingleJob(system, [meas, part, recipe, product]) {
  const request_id = await order(system, {meas_id: idOf(meas, 'MeasId'), part_id: idOf(part, 'PartId'),
    product_id: idOf(product, 'ProductId'), external_id: idOf(recipe, 'RecipeId')});
  return [{dataType: DataType.ExtensionObject, value: system.structure('JobIdDataType', {id: request_id})}, NO_ERROR];
}

async function cancel(system, cause) {
  if (system.state !== 'SingleExecution') {
    throw new MethodRefusal(StatusCodes.BadInvalidState, `the state is ${system.state}, must be SingleExecution`);
  }
  await system.jobs.cancelAll();
  system.observe(await system.service.visionState(), cause);
  return [NO_ERROR];
}

async function reset(system) {
  const observed = await system.service.visionState();
  if (system.state === 'Error' && observed === 'ERROR') {
    throw new MethodRefusal(StatusCodes.BadInvalidState, 'the service still has no free space on its disk');
  }
  if (system.state !== 'Error') throw new MethodRefusal(StatusCodes.BadInvalidState, `the state is ${system.state}, must be Error`);
  system.observe(observed, 'Reset');
  return [NO_ERROR];
}

export function bindJobMethods(system) {
  system.bind([...AUTOMATIC, 'StartSingleJob'], (inputs) => startSingleJob(system, inputs));
  system.bind([...AUTOMATIC, 'Stop'], () => cancel(system, 'Stop'));
  system.bind([...AUTOMATIC, 'Abort'], () => cancel(system, 'Abort'));
  system.refuse([...AUTOMATIC, 'StartContinuous'], StatusCodes.BadNotSupported, 'a job plans one part and ends; call StartSingleJob');
  system.refuse([...AUTOMATIC, 'SimulationMode'], StatusCodes.BadNotSupported, 'planning is a simulation always');
  system.bind([...MACHINE, 'Reset'], () => reset(system));
  system.refuse([...MACHINE, 'Halt'], StatusCodes.BadNotSupported, 'the service has other clients; its administrator ends it');
  const own = system.node.namespace;
  own.addMethod(system.node, {browseName: 'RepeatEvents', nodeId: `ns=${own.index};s=${system.name}.RepeatEvents`,
    inputArguments: [{name: 'AfterEventNumber', dataType: DataType.UInt64,
      description: {text: 'The last eight bytes of the last EventId that arrived; 0: from the first event that is kept.'}}],
    outputArguments: [{name: 'LastEventNumber', dataType: DataType.UInt64,
      description: {text: 'Number of the last event that was raised. Call again with it; the same number: there are no more.'}}]});
  system.bind(['RepeatEvents'], ([after]) => {
    const last = system.repeat(after[0] * 2 ** 32 + after[1]);
    return [{dataType: DataType.UInt64, arrayType: VariantArrayType.Scalar, value: [Math.floor(last / 2 ** 32), last % 2 ** 32]}];
  });
}

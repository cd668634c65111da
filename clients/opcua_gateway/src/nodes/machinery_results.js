// SPDX-License-Identifier: Apache-2.0
// ResultManagement of OPC UA for Machinery (OPC 40001-101): the same results as below OPC 40100-1's.
import opcua from 'node-opcua';
import {NO_ERROR} from './job_methods.js';
import {addIn} from './machinery.js';
import {Results} from './result_methods.js';
import {MethodRefusal} from './vision_system.js';

const {DataType, StatusCodes, VariantArrayType} = opcua;
const RESULT = 'http://opcfoundation.org/UA/Machinery/Result/';
const MANAGEMENT = ['MachineryBuildingBlocks', 'ResultManagement'];
const OPTIONALS = ['GetResultById', 'GetLatestResult', 'GetResultIdListFiltered', 'ReleaseResultHandle', 'ResultTransfer'];
const MAX_LIST = 1000;
// Answers hold no resources of the gateway.
const NO_HANDLE = {dataType: DataType.UInt32, value: 0};

class MachineryResults {
  constructor(system, transfers) {
    Object.assign(this, {system, results: new Results(system, transfers)});
    this.index = system.address_space.getNamespaceIndex(RESULT);
  }

  // The result as OPC 40001-101 has it: ids are texts, and there is no MeasId.
  structure(order) {
    const {address_space} = this.system;
    const f = this.results.fields(order);
    const type = (name) => address_space.findDataType(name, this.index);
    const meta = address_space.constructExtensionObject(type('ResultMetaDataType'), {resultId: f.resultId.id,
      hasTransferableDataOnFile: f.hasTransferableDataOnFile, isPartial: false, isSimulated: false, resultState: f.resultState,
      partId: f.partId.id, externalRecipeId: f.externalRecipeId.id, internalRecipeId: f.internalRecipeId.id,
      productId: f.productId.id, externalConfigurationId: f.externalConfigurationId.id,
      internalConfigurationId: f.internalConfigurationId.id, jobId: f.jobId.id, creationTime: f.creationTime,
      processingTimes: f.processingTimes, fileFormat: order.job.results.map((file) => file.name)});
    return address_space.constructExtensionObject(type('ResultDataType'), {resultMetaData: meta, resultContent: f.resultContent});
  }

  answer(order) {
    return [NO_HANDLE, {dataType: DataType.ExtensionObject, value: this.structure(order)}, NO_ERROR];
  }

  finished() {
    return [...this.system.ledger.orders.values()].filter((order) => order.job);
  }

  latest() {
    const newest = this.finished().at(-1);
    if (!newest) throw new MethodRefusal(StatusCodes.BadNotFound, 'there is no result yet');
    return this.answer(newest);
  }

  // Newest last, without filter and order of the caller's.
  list([filter, ordered_by, max_results]) {
    if (filter?.elements?.length || ordered_by?.length) {
      throw new MethodRefusal(StatusCodes.BadNotSupported, 'Filter and OrderedBy: must be empty; GetResultListFiltered of OPC 40100-1 filters');
    }
    const ids = this.finished().slice(-Math.min(max_results || MAX_LIST, MAX_LIST)).map((order) => order.job_id);
    return [NO_HANDLE, {dataType: DataType.String, arrayType: VariantArrayType.Array, value: ids}, NO_ERROR];
  }
}

export function addResultManagement(system, blocks, transfers) {
  addIn(system, blocks, [RESULT, 'ResultManagementType'], OPTIONALS);
  const results = new MachineryResults(system, transfers);
  const bind = (name, action) => system.bind([...MANAGEMENT, name], action);
  bind('GetResultById', ([id]) => results.answer(results.results.find(id ?? '')));
  bind('GetLatestResult', () => results.latest());
  bind('GetResultIdListFiltered', (inputs) => results.list(inputs));
  bind('ReleaseResultHandle', () => [NO_ERROR]);
  const transfer = [...MANAGEMENT, 'ResultTransfer'];
  system.bind([...transfer, 'GenerateFileForRead'], ([options], session) =>
    results.results.generateForRead([{id: options?.resultId}], session));
  system.refuse([...transfer, 'GenerateFileForWrite'], StatusCodes.BadNotSupported, 'results are read only');
  system.refuse([...transfer, 'CloseAndCommit'], StatusCodes.BadNotSupported, 'results are read only; call Close of the file');
}

// SPDX-License-Identifier: Apache-2.0
// ResultManagement: a job's results by its id (the ResultId), as files.
import path from 'node:path';
import {mkdtempSync, rmSync} from 'node:fs';
import opcua from 'node-opcua';
import {RESULT_STATES} from '../orders/client_jobs.js';
import {dateOf, idOf, NO_ERROR} from './job_methods.js';
import {pack} from './recipe_archive.js';
import {structureArray, structureValue} from './recipe_methods.js';
import {MethodRefusal} from './vision_system.js';

const {DataType, NodeId, StatusCodes, VariantArrayType} = opcua;
const MANAGEMENT = ['ResultManagement'];
const TRANSFER = ['ResultManagement', 'ResultTransfer'];
const MAX_LIST = 1000;
const MAX_FILE_ID_BYTES = 1000;

export class Results {
  constructor(system, transfers) {
    Object.assign(this, {system, transfers});
  }

  find(job_id) {
    const order = [...this.system.ledger.orders.values()].find((o) => o.job_id === job_id);
    if (!order?.job) {
      throw new MethodRefusal(order ? StatusCodes.BadInvalidState : StatusCodes.BadNotFound,
          order ? `result ${job_id}: the job is not finished` : `result ${job_id}: is unknown`);
    }
    return order;
  }

  fields(order) {
    const {job} = order;
    const time = (stamp) => dateOf(stamp) ?? new Date(0);
    return {resultId: {id: order.job_id}, hasTransferableDataOnFile: job.results.length > 0, isPartial: false, isSimulated: false,
      resultState: RESULT_STATES[job.state], measId: {id: order.meas_id}, partId: {id: order.part_id},
      externalRecipeId: {id: order.external_recipe_id}, internalRecipeId: {id: order.internal_recipe_id},
      productId: {id: order.product_id}, externalConfigurationId: {id: 'service'}, internalConfigurationId: {id: 'service'},
      jobId: {id: order.request_id}, creationTime: time(job.finished_at),
      processingTimes: {startTime: time(job.started_at), endTime: time(job.finished_at)},
      resultContent: [{dataType: DataType.String, arrayType: VariantArrayType.Scalar, value: this.content(order)}]};
  }

  // The result's files for programs: names, sizes and digests; or why there are none.
  content({job}) {
    return JSON.stringify({files: job.results.map(({name, size_bytes, digest}) => ({name, size_bytes, digest})),
      ...(job.failure ? {failure: job.failure} : {})});
  }

  byId([id]) {
    const order = this.find(idOf(id));
    return [{dataType: DataType.UInt32, value: 0}, structureValue(this.system, 'ResultDataType', this.fields(order)), NO_ERROR];
  }

  componentsById([id]) {
    const f = this.fields(this.find(idOf(id)));
    const flag = (value) => ({dataType: DataType.Boolean, value});
    const structure = (type, value) => structureValue(this.system, type, value);
    return [flag(f.hasTransferableDataOnFile), {dataType: DataType.UInt32, value: 0}, flag(false), flag(false),
      {dataType: DataType.Int32, value: f.resultState}, structure('MeasIdDataType', f.measId), structure('PartIdDataType', f.partId),
      structure('RecipeIdExternalDataType', f.externalRecipeId), structure('RecipeIdInternalDataType', f.internalRecipeId),
      structure('ProductIdDataType', f.productId), structure('ConfigurationIdDataType', f.externalConfigurationId),
      structure('ConfigurationIdDataType', f.internalConfigurationId), structure('JobIdDataType', f.jobId),
      {dataType: DataType.DateTime, value: f.creationTime}, structure('ProcessingTimesDataType', f.processingTimes),
      {dataType: DataType.Variant, arrayType: VariantArrayType.Array, value: f.resultContent}, NO_ERROR];
  }

  // Empty ids and state 0 match all. Newest last.
  list([state, meas, part, external, internal, external_configuration, internal_configuration, product, job, max_results, start]) {
    const matches = (wanted, value) => idOf(wanted) === '' || idOf(wanted) === value;
    const all = [...this.system.ledger.orders.values()].filter((o) => o.job &&
      (state === 0 || RESULT_STATES[o.job.state] === state) && matches(meas, o.meas_id) && matches(part, o.part_id) &&
      matches(external, o.external_recipe_id) && matches(internal, o.internal_recipe_id) && matches(product, o.product_id) &&
      matches(external_configuration, 'service') && matches(internal_configuration, 'service') && matches(job, o.request_id));
    const count = Math.min(max_results || MAX_LIST, MAX_LIST);
    const page = all.slice(start, start + count);
    return [{dataType: DataType.Boolean, value: start + page.length >= all.length}, {dataType: DataType.UInt32, value: page.length},
      {dataType: DataType.UInt32, value: 0}, structureArray(this.system, 'ResultDataType', page.map((o) => this.fields(o))), NO_ERROR];
  }

  // JOB_ID/NAME is one file of the result; JOB_ID alone is a tar archive of all.
  async generateForRead([options], session) {
    const [job_id, ...rest] = idOf(options?.id, 'Id', MAX_FILE_ID_BYTES).split('/');
    const name = rest.join('/');
    const order = this.find(job_id);
    const wanted = order.job.results.filter((file) => name === '' || file.name === name);
    if (wanted.length === 0) throw new MethodRefusal(StatusCodes.BadNotFound, `result ${job_id}: has no file ${name}`);
    // An archive needs room for its files and for itself.
    const bytes = wanted.reduce((sum, file) => sum + file.size_bytes, 0) * (name === '' ? 2 : 1);
    const transfer = await this.transfers.openForRead(session, bytes, (target) =>
      name === '' ? this.fetchAll(job_id, wanted, target) : this.system.service.fetchResult(job_id, name, target));
    return [{dataType: DataType.NodeId, value: transfer.node.nodeId}, {dataType: DataType.UInt32, value: transfer.handle},
      {dataType: DataType.NodeId, value: NodeId.nullNodeId}];
  }

  async fetchAll(job_id, wanted, target) {
    const folder = mkdtempSync(path.join(path.dirname(target), 'result-'));
    try {
      const files = {};
      for (const [i, file] of wanted.entries()) {
        files[file.name] = path.join(folder, String(i));
        await this.system.service.fetchResult(job_id, file.name, files[file.name]);
      }
      await pack(files, target);
    } finally {
      rmSync(folder, {recursive: true, force: true});
    }
  }
}

export function bindResultMethods(system, transfers) {
  const results = new Results(system, transfers);
  system.bind([...MANAGEMENT, 'GetResultById'], (inputs) => results.byId(inputs));
  system.bind([...MANAGEMENT, 'GetResultComponentsById'], (inputs) => results.componentsById(inputs));
  system.bind([...MANAGEMENT, 'GetResultListFiltered'], (inputs) => results.list(inputs));
  // Answers hold no resources of the gateway.
  system.bind([...MANAGEMENT, 'ReleaseResultHandle'], () => [NO_ERROR]);
  system.bind([...TRANSFER, 'GenerateFileForRead'], (inputs, session) => results.generateForRead(inputs, session));
  system.refuse([...TRANSFER, 'GenerateFileForWrite'], StatusCodes.BadNotSupported, 'results are read only');
  system.refuse([...TRANSFER, 'CloseAndCommit'], StatusCodes.BadNotSupported, 'results are read only; call Close of the file');
}

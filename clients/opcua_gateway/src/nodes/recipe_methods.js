// SPDX-License-Identifier: Apache-2.0
// RecipeManagement and ConfigurationManagement.
import {randomUUID} from 'node:crypto';
import {mkdirSync, mkdtempSync, readdirSync, renameSync, rmSync, statSync} from 'node:fs';
import path from 'node:path';
import opcua from 'node-opcua';
import {FULL_DISK_CODES, syncFolder} from '../orders/disk.js';
import {idOf, NO_ERROR} from './job_methods.js';
import {unpackRecipe} from './recipe_archive.js';
import {MethodRefusal} from './vision_system.js';

const {DataType, NodeId, StatusCodes, VariantArrayType} = opcua;
const MANAGEMENT = ['RecipeManagement'];
const TRANSFER = ['RecipeManagement', 'RecipeTransfer'];
const MAX_RECIPES = 1000;

export const structureValue = (system, type, fields) => ({dataType: DataType.ExtensionObject, value: system.structure(type, fields)});
export const structureArray = (system, type, rows) => ({dataType: DataType.ExtensionObject, arrayType: VariantArrayType.Array,
  value: rows.map((row) => system.structure(type, row))});

class Recipes {
  constructor(system, transfers, folder) {
    Object.assign(this, {system, transfers, folder});
    mkdirSync(folder, {recursive: true, mode: 0o700});
    // Folders that a killed gateway was unpacking into.
    for (const name of readdirSync(folder)) {
      if (!name.endsWith('.tar')) rmSync(path.join(folder, name), {recursive: true, force: true});
    }
    this.last = Promise.resolve();
  }

  // One action after the other: each finds recipes, service and ledger agreed.
  inTurn(action) {
    const result = this.last.then(action);
    this.last = result.catch(() => {});
    return result;
  }

  archive(internal_id) {
    return path.join(this.folder, `${internal_id}.tar`);
  }

  internal(recipe) {
    return {id: recipe.internal_id, ...(recipe.digest ? {hash: Buffer.from(recipe.digest, 'hex'), hashAlgorithm: 'SHA-256'} : {})};
  }

  // By internal id, or the newest of an external id.
  find(external_id, internal_id) {
    const all = [...this.system.ledger.recipes.values()];
    const found = internal_id ? this.system.ledger.recipes.get(internal_id) :
        all.filter((recipe) => recipe.external_id === external_id).at(-1);
    if (!found) throw new MethodRefusal(StatusCodes.BadNotFound, `recipe ${internal_id || external_id}: is unknown`);
    if (external_id && found.external_id !== external_id) {
      throw new MethodRefusal(StatusCodes.BadInvalidArgument, `InternalId: is of the recipe ${found.external_id}, not ${external_id}`);
    }
    return found;
  }

  add([external, product]) {
    const external_id = idOf(external, 'ExternalId');
    if (external_id === '') throw new MethodRefusal(StatusCodes.BadInvalidArgument, 'ExternalId: must have 1 to 128 bytes');
    if (this.system.ledger.recipes.size >= MAX_RECIPES) {
      throw new MethodRefusal(StatusCodes.BadResourceUnavailable, `there are ${MAX_RECIPES} recipes; remove some`);
    }
    const recipe = {internal_id: randomUUID(), external_id, product_id: idOf(product, 'ProductId'), prepared: false, has_content: false};
    this.system.ledger.write({recipe});
    return [structureValue(this.system, 'RecipeIdInternalDataType', this.internal(recipe)),
      {dataType: DataType.NodeId, value: NodeId.nullNodeId}, {dataType: DataType.NodeId, value: NodeId.nullNodeId},
      {dataType: DataType.Boolean, value: true}, NO_ERROR];
  }

  async remove([external]) {
    const recipe = this.find(idOf(external, 'ExternalId'), '');
    if (recipe.prepared) await this.unprepare([external, null]);
    this.system.ledger.write({removed_recipe: recipe.internal_id});
    rmSync(this.archive(recipe.internal_id), {force: true});
    return [NO_ERROR];
  }

  // Transfers of the recipe's archive.
  generateForWrite([options], session) {
    const recipe = this.find('', idOf(options?.internalId, 'InternalId'));
    const transfer = this.transfers.openForWrite(session, {internal_id: recipe.internal_id});
    return [{dataType: DataType.NodeId, value: transfer.node.nodeId}, {dataType: DataType.UInt32, value: transfer.handle}];
  }

  closeAndCommit([handle], session) {
    const transfer = this.transfers.find(session, handle);
    if (!transfer?.about.internal_id) throw new MethodRefusal(StatusCodes.BadInvalidArgument, `FileHandle ${handle}: is not open`);
    const {internal_id} = this.find('', transfer.about.internal_id);
    this.transfers.close(transfer, true);
    renameSync(transfer.file, this.archive(internal_id));
    syncFolder(this.folder);
    this.system.ledger.write({recipe: {internal_id, has_content: true, last_modified: new Date().toISOString()}});
    return [{dataType: DataType.NodeId, value: NodeId.nullNodeId}];
  }

  async prepare([external, internal]) {
    const recipe = this.find(idOf(external, 'ExternalId'), idOf(internal, 'InternalId'));
    const hash = internal?.hash;
    if (hash?.length > 0 && recipe.digest && !hash.equals(Buffer.from(recipe.digest, 'hex'))) {
      throw new MethodRefusal(StatusCodes.BadInvalidArgument, 'InternalId.Hash: is of another content');
    }
    if (!recipe.has_content) throw new MethodRefusal(StatusCodes.BadInvalidState, `recipe ${recipe.external_id}: has no content yet`);
    this.transfers.checkRoom(statSync(this.archive(recipe.internal_id)).size);
    const folder = mkdtempSync(path.join(this.folder, 'unpacked-'));
    try {
      const {task, files} = await unpackRecipe(this.archive(recipe.internal_id), folder).catch((error) => {
        if (FULL_DISK_CODES.includes(error.code)) throw error;
        throw new MethodRefusal(StatusCodes.BadInvalidArgument, error.message);
      });
      const {digest} = await this.system.service.prepareRecipe(recipe.external_id, task, files);
      // The service has one recipe of a name: an older one of it is not prepared any more.
      for (const other of this.system.ledger.recipes.values()) {
        if (other.prepared && other.external_id === recipe.external_id && other !== recipe) {
          this.system.ledger.write({recipe: {internal_id: other.internal_id, prepared: false}});
        }
      }
      this.system.ledger.write({recipe: {internal_id: recipe.internal_id, prepared: true, digest},
        events: [{type: 'RecipePrepared', internal_id: recipe.internal_id, external_id: recipe.external_id}]});
    } finally {
      rmSync(folder, {recursive: true, force: true});
    }
    this.system.raiseWaiting();
    this.system.observe(await this.system.service.visionState(), 'PrepareRecipe');
    return [structureValue(this.system, 'RecipeIdInternalDataType', this.internal(this.find('', recipe.internal_id))),
      {dataType: DataType.Boolean, value: true}, NO_ERROR];
  }

  async unprepare([external, internal]) {
    const recipe = this.find(idOf(external, 'ExternalId'), idOf(internal, 'InternalId'));
    // The service has the name's prepared recipe: unpreparing another one of that name leaves it.
    if (recipe.prepared) await this.system.service.call('UnprepareRecipe', {recipe_id: recipe.external_id});
    this.system.ledger.write({recipe: {internal_id: recipe.internal_id, prepared: false}});
    this.system.observe(await this.system.service.visionState(), 'UnprepareRecipe');
    return [structureValue(this.system, 'RecipeIdInternalDataType', this.internal(recipe)), NO_ERROR];
  }

  // IsPrepared: 0 false, 1 true, 2 all the same.
  list([external, product, is_prepared, max_results, start]) {
    const [external_id, product_id] = [idOf(external, 'ExternalId'), idOf(product, 'ProductId')];
    const all = [...this.system.ledger.recipes.values()].filter((recipe) =>
      (external_id === '' || recipe.external_id === external_id) && (product_id === '' || recipe.product_id === product_id) &&
      (is_prepared === 2 || recipe.prepared === (is_prepared === 1)));
    const page = all.slice(start, max_results > 0 ? start + max_results : undefined);
    return [{dataType: DataType.Boolean, value: start + page.length >= all.length}, {dataType: DataType.UInt32, value: page.length},
      {dataType: DataType.UInt32, value: 0}, structureArray(this.system, 'RecipeIdInternalDataType', page.map((r) => this.internal(r))),
      NO_ERROR];
  }
}

export function bindRecipeMethods(system, transfers, folder) {
  const recipes = new Recipes(system, transfers, folder);
  const management = {AddRecipe: 'add', RemoveRecipe: 'remove', PrepareRecipe: 'prepare', UnprepareRecipe: 'unprepare', GetRecipeListFiltered: 'list'};
  for (const [name, action] of Object.entries(management)) {
    system.bind([...MANAGEMENT, name], (inputs) => recipes.inTurn(() => recipes[action](inputs)));
  }
  system.bind([...TRANSFER, 'GenerateFileForWrite'], (inputs, session) => recipes.generateForWrite(inputs, session));
  system.bind([...TRANSFER, 'CloseAndCommit'], (inputs, session) => recipes.inTurn(() => recipes.closeAndCommit(inputs, session)));
  system.refuse([...TRANSFER, 'GenerateFileForRead'], StatusCodes.BadNotSupported, 'recipes are not given back; keep yours');

  // The service has one configuration, its own.
  const configuration = {hasTransferableDataOnFile: false, internalId: {id: 'service'}, lastModified: new Date()};
  system.child('ConfigurationManagement', 'ActiveConfiguration').setValueFromSource(
      structureValue(system, 'ConfigurationDataType', configuration));
  const handle = {dataType: DataType.UInt32, value: 0};
  system.bind(['ConfigurationManagement', 'GetConfigurationList'], () => [{dataType: DataType.Boolean, value: true},
    {dataType: DataType.UInt32, value: 1}, handle, structureArray(system, 'ConfigurationDataType', [configuration]), NO_ERROR]);
  system.bind(['ConfigurationManagement', 'GetConfigurationById'], ([id]) => {
    if (idOf(id) !== 'service') throw new MethodRefusal(StatusCodes.BadNotFound, `configuration ${idOf(id)}: is unknown`);
    return [handle, structureValue(system, 'ConfigurationDataType', configuration), NO_ERROR];
  });
  system.bind(['ConfigurationManagement', 'ActivateConfiguration'], ([id]) => {
    if (idOf(id) !== 'service') throw new MethodRefusal(StatusCodes.BadNotFound, `configuration ${idOf(id)}: is unknown`);
    return [NO_ERROR];
  });
}

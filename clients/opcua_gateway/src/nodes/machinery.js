// SPDX-License-Identifier: Apache-2.0
// Building blocks of OPC UA for Machinery at a vision system: its identification and item state
// (OPC 40001-1), and a place for the other ones. Every system is one of the Machines of the server.
import {readFileSync} from 'node:fs';
import opcua from 'node-opcua';
import {topState} from '../orders/vision_states.js';

const {coerceQualifiedName, DataType, LocalizedText} = opcua;
export const MACHINERY = 'http://opcfoundation.org/UA/Machinery/';
const PRODUCT = 'urn:sightline:opcua-gateway';
const {version} = JSON.parse(readFileSync(new URL('../../package.json', import.meta.url), 'utf8'));

// MachineryItemState by the top state of the vision state machine; OPC 40001-1, 12.2: out of service is
// what needs somebody to mend it.
const ITEM_STATES = {Preoperational: 'NotAvailable', Error: 'OutOfService', Operational: 'NotExecuting'};

export function itemState(state) {
  return state === 'SingleExecution' ? 'Executing' : ITEM_STATES[topState(state)];
}

// An object of the type, as an add-in below `parent`, with the type's own browse name.
export function addIn(system, parent, [uri, type], optionals = []) {
  const {address_space} = system;
  const declared = address_space.findObjectType(type, address_space.getNamespaceIndex(uri));
  const browse_name = coerceQualifiedName(declared.getPropertyByName('DefaultInstanceBrowseName').readValue().value.value);
  return declared.instantiate({browseName: browse_name, namespace: system.node.namespace, addInOf: parent, optionals,
    nodeId: `${parent.nodeId.toString()}.${browse_name.name}`});
}

function identify(system) {
  const node = addIn(system, system.node, [MACHINERY, 'MachineIdentificationType'], ['Model', 'SoftwareRevision', 'ManufacturerUri']);
  const set = (name, dataType, value) => node.getPropertyByName(name).setValueFromSource({dataType, value});
  set('Manufacturer', DataType.LocalizedText, new LocalizedText('Sightline'));
  set('ManufacturerUri', DataType.String, PRODUCT);
  set('Model', DataType.LocalizedText, new LocalizedText('Planning service'));
  set('SoftwareRevision', DataType.String, version);
  // The ledger's id is made once and stays with the data folder.
  set('SerialNumber', DataType.String, system.ledger.id);
  set('ProductInstanceUri', DataType.String, `${PRODUCT}:${system.ledger.id}`);
}

function showItemState(machine, type, state) {
  const current = machine.getChildByName('CurrentState');
  current.setValueFromSource({dataType: DataType.LocalizedText, value: new LocalizedText(state)});
  current.getChildByName('Id').setValueFromSource({dataType: DataType.NodeId, value: type.getChildByName(state).nodeId});
}

// The folder MachineryBuildingBlocks of the system, with its item state.
export function addMachinery(system) {
  const {address_space, node} = system;
  const index = address_space.getNamespaceIndex(MACHINERY);
  const machines = address_space.rootFolder.objects.getFolderElementByName('Machines', index);
  machines.addReference({referenceType: 'Organizes', nodeId: node.nodeId});
  identify(system);
  const blocks = node.namespace.addObject({componentOf: node, typeDefinition: 'FolderType',
    browseName: {name: 'MachineryBuildingBlocks', namespaceIndex: index}, nodeId: `${node.nodeId.toString()}.MachineryBuildingBlocks`});
  const type = [MACHINERY, 'MachineryItemState_StateMachineType'];
  const machine = addIn(system, blocks, type);
  const declared = address_space.findObjectType(type[1], index);
  system.onObserved(() => showItemState(machine, declared, itemState(system.state)));
  return blocks;
}

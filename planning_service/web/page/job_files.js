// SPDX-License-Identifier: Apache-2.0
// Files of a job: which ones the task names, under which names they are sent, and which of the
// chosen files they are.

const MESH = /\.(step|stp|p21|glb|gltf|stl|ply|obj)$/i;
export function isMeshName(name) { return MESH.test(name); }
// STEP says its unit itself, glTF is in metres by its standard; the others carry no unit.
export function carriesUnit(name) { return /\.(step|stp|p21|glb|gltf)$/i.test(name); }

// Files of measured points; a PLY file may also be a part.
export function isMeasuredName(name) { return /\.(ply|pcd|csv|png|tiff?)$/i.test(name); }

// Name under which a file is sent: the path in the task without what leads out of the job's folder.
export function sentName(reference) {
  const parts = [];
  for (const part of reference.replaceAll('\\', '/').replace(/^[a-z]:/i, '').split('/')) {
    if (part === '' || part === '.') continue;
    if (part === '..') {
      parts.pop();
    } else {
      parts.push(part);
    }
  }
  return parts.join('/');
}

function baseName(name) { return name.slice(name.lastIndexOf('/') + 1); }
function folderOf(name) { return name.slice(0, name.lastIndexOf('/') + 1); }

// Calls visit(value, path) for every text below `value` that names a file.
function visitFileFields(value, path, visit) {
  if (Array.isArray(value)) {
    value.forEach((entry, i) => visitFileFields(entry, `${path}[${i}]`, visit));
  } else if (typeof value === 'object' && value !== null) {
    for (const [name, entry] of Object.entries(value)) {
      const inner = path ? `${path}.${name}` : name;
      if (typeof entry === 'string' && (name === 'file' || name.endsWith('_file'))) {
        if (entry !== '') visit(entry, inner);
      } else {
        visitFileFields(entry, inner, visit);
      }
    }
  }
}

// The task with every file under the name it is sent by.
export function withSentNames(value) {
  if (Array.isArray(value)) return value.map(withSentNames);
  if (typeof value !== 'object' || value === null) return value;
  return Object.fromEntries(Object.entries(value).map(([name, entry]) => {
    const isFile = typeof entry === 'string' && (name === 'file' || name.endsWith('_file'));
    return [name, isFile ? sentName(entry) : withSentNames(entry)];
  }));
}

// The chosen file that a name means: the same path, else the only one whose path ends like it, else the
// only one of the same base name. Of several, none is guessed.
function chosenFile(name, chosen) {
  const exact = chosen.find((file) => file.path === name);
  if (exact) return exact;
  const ending = chosen.filter((file) => file.path.endsWith(`/${name}`));
  const same = ending.length ? ending : chosen.filter((file) => baseName(file.path) === baseName(name));
  return same.length === 1 ? same[0] : null;
}

// [{name, path, file}] of all files that a task needs, each once: `name` it is sent by, `path` of the
// field that names it, `file` of `chosen` ([{path, json}]) or null. Files that chosen JSON files
// (materials) name are among them, relative to that file.
export function neededFiles(task, chosen) {
  const needed = new Map();
  const open = [];
  const add = (reference, path, folder) => {
    const name = sentName(folder + reference);
    if (!name || needed.has(name)) return;
    const entry = {name, path, file: chosenFile(name, chosen)};
    needed.set(name, entry);
    open.push(entry);
  };
  visitFileFields(task, '', (reference, path) => add(reference, path, ''));
  // A depth raster is described by the JSON file beside it.
  for (const {file} of task.inspect_options?.measured ?? []) {
    if (/\.(png|tiff?)$/i.test(file)) add(file.replace(/\.[^.]*$/, '.json'), 'inspect_options.measured', '');
  }
  for (let i = 0; i < open.length && i < 10000; ++i) {
    const {name, path, file} = open[i];
    if (file?.json) {
      visitFileFields(file.json, '', (reference, inner) => add(reference, `${path}: ${inner}`, folderOf(name)));
    }
  }
  return [...needed.values()];
}

// Role of a JSON file by its content: 'inspection', 'recordings', 'plan', or 'other' (cameras,
// materials).
export function roleOfJson(json) {
  if (typeof json !== 'object' || json === null || Array.isArray(json)) return 'other';
  if (Array.isArray(json.recordings) || json.format === 'laser-line-recordings') return 'recordings';
  if (typeof json.part === 'object' && json.part !== null) return 'inspection';
  if (Array.isArray(json.scans)) return 'plan';
  return 'other';
}

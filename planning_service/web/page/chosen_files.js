// SPDX-License-Identifier: Apache-2.0
// Files and folders from a drop or a file button.

const MAX_FILES = 5000;

async function filesOfEntry(entry, folder, files) {
  if (files.length >= MAX_FILES) return;
  if (entry.isFile) {
    const blob = await new Promise((resolve, reject) => entry.file(resolve, reject));
    files.push({path: folder + blob.name, blob});
  } else if (entry.isDirectory) {
    const reader = entry.createReader();
    for (;;) {
      // A folder comes in portions; an empty one is the end.
      const entries = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
      if (entries.length === 0 || files.length >= MAX_FILES) return;
      for (const inner of entries) await filesOfEntry(inner, `${folder}${entry.name}/`, files);
    }
  }
}

// [{path, blob}]; at most 5000.
export async function droppedFiles(transfer) {
  // The list of items is gone after the first wait.
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
  if (entries.length === 0) return [...transfer.files].map((blob) => ({path: blob.name, blob}));
  const files = [];
  for (const entry of entries) await filesOfEntry(entry, '', files);
  return files;
}

export function filesOfInput(input) {
  return [...input.files].slice(0, MAX_FILES)
      .map((blob) => ({path: blob.webkitRelativePath || blob.name, blob}));
}

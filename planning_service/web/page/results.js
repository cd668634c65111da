// SPDX-License-Identifier: Apache-2.0
// Results of jobs where requests carry a token, which links of a page cannot.
import {request} from './api.js';

export async function download(path, name) {
  const answer = await request(path);
  const address = URL.createObjectURL(await answer.blob());
  const link = document.createElement('a');
  link.href = address;
  link.download = name.split('/').at(-1);
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 60000);
}

// In a new tab, by a service worker that adds the token. Where there is none (it needs HTTPS or this
// machine) the report, which is one file complete in itself, is saved instead.
export async function openReport(path) {
  if (!('serviceWorker' in navigator)) {
    await download(path, 'report.html');
    return;
  }
  // Opened at once: a browser allows it as the answer to a click only.
  const tab = window.open('', '_blank');
  try {
    await navigator.serviceWorker.register('results_worker.js');
    await navigator.serviceWorker.ready;
    tab.opener = null;
    tab.location.href = new URL(path, document.baseURI).href;
  } catch {
    tab?.close();
    await download(path, 'report.html');
  }
}

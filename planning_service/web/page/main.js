// SPDX-License-Identifier: Apache-2.0
// The page of the planning service: routes, and the token where the service wants one.
//
//   #/new[?kind=…&plan=…]   a new job
//   #/jobs                  all jobs
//   #/jobs/ID               one job
import {onTokenChange, setToken, setTokenQuestion, token} from './api.js';
import {h} from './dom.js';
import {JobListView} from './job_list.js';
import {JobView} from './job_view.js';
import {NewJobView} from './new_job.js';

const main = document.getElementById('main');
const makers = {new: () => new NewJobView(), jobs: () => new JobListView(), job: () => new JobView()};
const titles = {new: 'New job', jobs: 'Jobs', job: 'Job'};
const views = {};
let current = null;

function route() {
  const [path, query = ''] = location.hash.replace(/^#\/?/, '').split('?');
  const [first, id] = path.split('/');
  if (first !== 'jobs') return {name: 'new', parameters: Object.fromEntries(new URLSearchParams(query))};
  try {
    return id ? {name: 'job', parameters: {id: decodeURIComponent(id)}} : {name: 'jobs', parameters: {}};
  } catch {
    return {name: 'jobs', parameters: {}};
  }
}

function go(isFirst) {
  const {name, parameters} = route();
  if (current) {
    current.hide();
    current.element.hidden = true;
  }
  current = views[name];
  if (!current) {
    current = views[name] = makers[name]();
    main.append(current.element);
  }
  current.element.hidden = false;
  document.title = `${titles[name]} · Sightline`;
  for (const link of document.querySelectorAll('nav a')) {
    const isHere = link.dataset.view === name || (link.dataset.view === 'jobs' && name === 'job');
    if (isHere) {
      link.setAttribute('aria-current', 'page');
    } else {
      link.removeAttribute('aria-current');
    }
  }
  current.show(parameters);
  // The focus moves to the heading, so that screen readers announce the new page.
  if (!isFirst) {
    window.scrollTo(0, 0);
    current.heading.focus({preventScroll: true});
  }
}

// --- token ----------------------------------------------------------------------------------------

function askForToken(wasRefused) {
  return new Promise((resolve) => {
    const input = h('input', {type: 'password', id: 'token', autocomplete: 'off', required: true, 'aria-describedby': 'token-text'});
    const dialog = h('dialog', {'aria-labelledby': 'token-title'},
        h('form', {method: 'dialog', onsubmit: () => setToken(input.value.trim())},
            h('h2', {id: 'token-title'}, 'Token'),
            h('p', {id: 'token-text'}, wasRefused ? 'The service does not know this token. ' : 'The service asks who you are. ',
                'It is kept until this tab is closed.'),
            h('p', {class: 'field'}, h('label', {for: 'token'}, 'Token'), input),
            h('p', {class: 'buttons'}, h('button', {class: 'primary', value: 'yes'}, 'Use it'),
                h('button', {type: 'button', onclick: () => dialog.close('no')}, 'Not now'))));
    dialog.addEventListener('close', () => {
      dialog.remove();
      resolve(dialog.returnValue === 'yes' && token() !== '');
    });
    document.body.append(dialog);
    dialog.showModal();
    input.focus();
  });
}

setTokenQuestion(askForToken);
const forget = document.getElementById('forget-token');
function showToken() { forget.hidden = !token(); }
forget.addEventListener('click', () => setToken(''));
onTokenChange(showToken);
showToken();

// A report opened in another tab: its request is made by the service worker.
navigator.serviceWorker?.addEventListener('message', ({data, ports}) => {
  if (data === 'sightline-token') ports[0]?.postMessage(token());
});

window.addEventListener('hashchange', () => go(false));
// A file that misses the marked places must not replace the page.
for (const type of ['dragover', 'drop']) window.addEventListener(type, (event) => event.preventDefault());
go(true);

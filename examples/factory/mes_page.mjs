// SPDX-License-Identifier: Apache-2.0
// The page of the simulated MES: an order, what happened, the plan's scans and its files. One HTML
// document without scripts, which lies beside the files that it links to.

const ESCAPES = {'&': '&amp;', '<': '&lt;', '>': '&gt;', '"': '&quot;'};
const escape = (text) => String(text).replace(/[&<>"]/g, (character) => ESCAPES[character]);

const STYLE = `body { font: 16px/1.5 sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; background: #fff }
h1 { font-size: 1.5rem } h2 { font-size: 1.15rem; margin-top: 2rem }
.wide { overflow-x: auto } table { border-collapse: collapse; width: 100% }
th, td { text-align: left; padding: .25rem .75rem .25rem 0; border-bottom: 1px solid #ccc }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums }
.done { color: #0a5c2b } .failed { color: #9c1c1c }`;

function table(headings, rows, is_number = () => false) {
  const cells = (element, row) => row.map((cell, column) =>
    `<${element}${element === 'th' ? ' scope="col"' : ''}${is_number(column) ? ' class="number"' : ''}>${escape(cell)}</${element}>`).join('');
  return `<div class="wide" tabindex="0" role="group"><table><thead><tr>${cells('th', headings)}</tr></thead>
<tbody>${rows.map((row) => `<tr>${cells('td', row)}</tr>`).join('\n')}</tbody></table></div>`;
}

const millimetres = (length_m) => (1000 * length_m).toFixed(1);
const degrees = (angle_deg) => angle_deg.toFixed(1);

const SCAN_HEADINGS = ['Scan', 'Camera distance [mm]', 'Triangulation', 'Camera azimuth', 'Camera polar', 'Part alpha', 'Part beta', 'Part gamma'];

function scanRows(plan) {
  return plan.scans.map(({measurement}, i) => [i + 1, millimetres(measurement.camera_distance_m),
    ...['triangulation_angle_deg', 'camera_azimuth_deg', 'camera_polar_deg', 'part_alpha_deg', 'part_beta_deg', 'part_gamma_deg']
        .map((field) => degrees(measurement[field] ?? 0))]);
}

function eventRows(events) {
  return events.map(({time, type, message}) => [new Date(time).toISOString().replace('T', ' ').slice(0, 19),
    type.replace(/EventType$/, ''), message]);
}

// `order`: {job_id, events}; `plan`: the plan.json; `saved`: names of the files beside the page.
export function mesPage({order, plan, saved}) {
  const coverage = plan.coverage?.coverage;
  const one = plan.scans.length === 1;
  const share = coverage === undefined ? '' : `, which ${one ? 'sees' : 'see'} ${(100 * coverage).toFixed(1)} % of the surface`;
  const links = saved.map((name) => `<li><a href="${escape(encodeURIComponent(name))}">${escape(name)}</a></li>`).join('\n');
  return `<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Order ${escape(order.job_id)}</title>
<style>${STYLE}</style>
</head>
<body>
<main>
<h1>Order ${escape(order.job_id)}</h1>
<p class="done">The plan of ${escape(plan.inspection_name ?? 'the part')} has ${plan.scans.length} ${one ? 'scan' : 'scans'}${share}.</p>
<h2>What happened</h2>
${table(['UTC', 'Event', 'Message'], eventRows(order.events))}
<h2>Scans</h2>
<p>Angles are in degrees.</p>
${table(SCAN_HEADINGS, scanRows(plan), () => true)}
<h2>Files</h2>
<ul>
${links}
</ul>
</main>
</body>
</html>
`;
}

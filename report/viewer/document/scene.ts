// SPDX-License-Identifier: Apache-2.0
// The view in three dimensions: controls of scene.html, which only pages with a scene have.
import {element} from './elements';
import {Scene} from './report_data';

declare global {
  // The script that draws scenes sets it.
  var sightlineShowScene: ((scene: Scene) => void) | undefined;
}

const template = (): HTMLTemplateElement | null => document.querySelector('template#scene-template');
let waiting: Scene | null = null;

/** Whether rows of tables steer a view. */
export const hasScene = (): boolean => template() !== null;

export function sceneElement(scene: Scene): HTMLElement {
  const controls = template();
  if (!controls || waiting) return element('p', {class: 'notice'}, 'This page cannot show a second scene. See report.json.');
  waiting = scene;
  // Moved, not copied: ids stay unique.
  return element('div', {class: 'scene'}, controls.content);
}

/** Starts the view once its controls stand in the page. */
export function showScene(): void {
  if (waiting) globalThis.sightlineShowScene?.(waiting);
}

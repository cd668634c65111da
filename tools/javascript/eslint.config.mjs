// SPDX-License-Identifier: Apache-2.0
// Rules for the JavaScript of the web pages, their tests and the Node.js client: mistakes, not style.
import js from '@eslint/js';
import globals from 'globals';

export default [
  {ignores: ['build/**', '**/node_modules/**']},
  js.configs.recommended,
  {
    languageOptions: {ecmaVersion: 2022, sourceType: 'module'},
    linterOptions: {reportUnusedDisableDirectives: 'error'},
    rules: {
      eqeqeq: 'error',
      'no-shadow': 'error',
      'no-var': 'error',
      'prefer-const': 'error',
    },
  },
  {
    files: ['planner_client/**/*.js', 'report/**/*.js', 'planning_service/**/*.js'],
    languageOptions: {globals: {...globals.browser, ...globals.serviceworker}},
  },
  {
    files: ['clients/**/*.js', 'examples/**/*.mjs', 'clients/**/*.mjs', 'tests/**/*.mjs', 'tests/**/*.cjs', 'deploy/**/*.mjs'],
    // The browser tests hand functions to the page.
    languageOptions: {globals: {...globals.node, ...globals.browser}},
  },
];

// SPDX-License-Identifier: Apache-2.0
// The state machine of OPC 40100-1 as data, and the transitions that follow what the planning
// service says. Pure functions: tests/vision_states_test.mjs compares the table with the nodeset and
// walks it at random.

// [name, from, to] of the transitions of VisionStateMachineType and, with states of
// Operational, of VisionAutomaticModeStateMachineType. Transitions into Operational enter
// Initialized. Left out are those that the gateway never takes: Halted and ContinuousExecution.
export const TRANSITIONS = [
  ['PreoperationalToErrorAuto', 'Preoperational', 'Error'],
  ['PreoperationalToOperationalAuto', 'Preoperational', 'Operational'],
  ['OperationalToErrorAuto', 'Operational', 'Error'],
  ['OperationalToPreoperationalAuto', 'Operational', 'Preoperational'],
  ['ErrorToPreoperational', 'Error', 'Preoperational'],
  ['ErrorToPreoperationalAuto', 'Error', 'Preoperational'],
  ['InitializedToReadyRecipe', 'Initialized', 'Ready'],
  ['InitializedToReadyAuto', 'Initialized', 'Ready'],
  ['ReadyToInitializedRecipe', 'Ready', 'Initialized'],
  ['ReadyToInitializedAuto', 'Ready', 'Initialized'],
  ['ReadyToSingleExecution', 'Ready', 'SingleExecution'],
  ['ReadyToSingleExecutionAuto', 'Ready', 'SingleExecution'],
  ['SingleExecutionToReadyAuto', 'SingleExecution', 'Ready'],
  ['SingleExecutionToReadyStop', 'SingleExecution', 'Ready'],
  ['SingleExecutionToReadyAbort', 'SingleExecution', 'Ready'],
];

// A cause is the method that asked for the change; without one, transitions end in "Auto".
const CAUSES = {
  InitializedToReady: {PrepareRecipe: 'Recipe'},
  ReadyToInitialized: {UnprepareRecipe: 'Recipe'},
  ReadyToSingleExecution: {StartSingleJob: ''},
  SingleExecutionToReady: {Stop: 'Stop', Abort: 'Abort'},
  ErrorToPreoperational: {Reset: ''},
};

export const OPERATIONAL_STATES = ['Initialized', 'Ready', 'SingleExecution'];

export const topState = (state) => OPERATIONAL_STATES.includes(state) ? 'Operational' : state;

function transition(from, to, cause) {
  return `${from}To${to}${CAUSES[`${from}To${to}`]?.[cause] ?? 'Auto'}`;
}

// The steps from `state` to what the service says: PREOPERATIONAL (it does not answer), ERROR,
// INITIALIZED, READY or SINGLE_EXECUTION. Each step is {transition, state}. Error is left by the
// method Reset alone, and only when the service has left it or is away.
export function follow(state, observed, cause) {
  const steps = [];
  const go = (to, why) => {
    const from = OPERATIONAL_STATES.includes(to) && OPERATIONAL_STATES.includes(state) ? state : topState(state);
    const target = OPERATIONAL_STATES.includes(to) && !OPERATIONAL_STATES.includes(state) ? 'Operational' : to;
    steps.push({transition: transition(from, target, why), state: to});
    state = to;
  };
  if (state === 'Error') {
    if (cause !== 'Reset' || observed === 'ERROR') return steps;
    go('Preoperational', 'Reset');
  }
  if (observed === 'PREOPERATIONAL') {
    if (state !== 'Preoperational') go('Preoperational');
    return steps;
  }
  if (observed === 'ERROR') {
    go('Error');
    return steps;
  }
  if (state === 'Preoperational') go('Initialized');
  const target = {INITIALIZED: 0, READY: 1, SINGLE_EXECUTION: 2}[observed];
  for (let at = OPERATIONAL_STATES.indexOf(state); at !== target;) {
    at += Math.sign(target - at);
    go(OPERATIONAL_STATES[at], cause);
  }
  return steps;
}

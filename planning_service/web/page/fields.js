// SPDX-License-Identifier: Apache-2.0
// The form: sections and their fields, by path in the task. Defaults and limits are those of
// docs/plan-a-part.md; limits are the service's to check.
//
// `exponent`: the service's unit is ten to that power of the form's (mm: -3).

const MM = {unit: 'mm', exponent: -3};
const UM = {unit: 'µm', exponent: -6};
const PERCENT = {unit: '%', exponent: -2};
const DEG = {unit: 'deg', exponent: 0};
const PX = {unit: 'px', exponent: 0};
const S = {unit: 's', exponent: 0};
const MM_PER_S = {unit: 'mm/s', exponent: -3};
const NONE = {unit: '', exponent: 0};

const number = (path, label, unit, fallback, more = {}) =>
  ({type: 'number', path, label, ...unit, fallback, ...more});
const whole = (path, label, unit, fallback, more = {}) =>
  ({type: 'number', integer: true, path, label, ...unit, fallback, ...more});
const domain = (path, label, unit, fallback, more = {}) =>
  ({type: 'domain', path: `inspection.measurement.${path}`, label, ...unit, fallback, ...more});
const flag = (path, label, more = {}) => ({type: 'flag', path, label, ...NONE, ...more});

const PLANNING = ['plan', 'evaluate', 'inspect', 'accept', 'optics', 'render'];

export const SECTIONS = [
  {
    id: 'camera', title: 'Camera and lens', kinds: PLANNING,
    fields: [
      whole('inspection.camera.columns_px', 'Columns', PX, '512'),
      whole('inspection.camera.rows_px', 'Rows', PX, '512'),
      number('inspection.camera.pixel_pitch_m', 'Pixel size', UM, 'not given'),
      number('inspection.lens.focal_length_m', 'Focal length', MM, 'not given'),
      number('inspection.lens.f_number', 'f-number', NONE, 'not given'),
      number('inspection.camera.vertical_fov_deg', 'Angle of view, vertical', DEG, '45',
             {help: 'With a lens: by rows, pixel size and focal length.'}),
    ],
    more: [
      number('inspection.lens.focus_distance_m', 'Focus distance', MM, 'rig’s origin'),
      number('inspection.rig.max_range_m', 'Farthest point that counts', MM, '1500',
             {help: 'From the camera.'}),
    ],
  },
  {
    id: 'laser', title: 'Laser', kinds: PLANNING,
    fields: [
      number('inspection.laser.fan_angle_deg', 'Fan angle', DEG, '90', {help: 'Full angle.'}),
      number('inspection.laser.distance_m', 'Working distance', MM, 'as the camera’s'),
    ],
  },
  {
    id: 'arrangement', title: 'What a scan may be', kinds: PLANNING,
    intro: 'A number, a list (200, 300) or ranges (-80 to -10, 10 to 80).',
    fields: [
      domain('camera_distance_m', 'Camera working distance', MM, '100 to 800'),
      domain('triangulation_angle_deg', 'Triangulation angle', DEG, '-80 to -10, 10 to 80',
             {help: 'Negative: laser below the camera.'}),
      number('inspection.rig.scan_step_m', 'Scan step', MM, '1', {help: 'Stage travel between frames.'}),
      number('inspection.rig.stage_travel_m', 'Stage travel', MM, '1000', {help: 'Longest scan.'}),
    ],
    moreTitle: 'Angles of camera and part, offsets',
    more: [
      domain('camera_azimuth_deg', 'Camera azimuth', DEG, '0 to 360'),
      domain('camera_polar_deg', 'Camera polar angle', DEG, '0 to 90', {help: '0: from above.'}),
      domain('part_alpha_deg', 'Part turn α', DEG, '0 to 360'),
      domain('part_beta_deg', 'Part turn β', DEG, '0 to 360'),
      domain('part_gamma_deg', 'Part turn γ', DEG, '0 to 360'),
      domain('offset_y_m', 'Offset y', MM, '-500 to 500'),
      domain('offset_z_m', 'Offset z', MM, '-400 to 400'),
    ],
  },
  {
    id: 'goal', title: 'Goal', kinds: ['plan', 'evaluate'],
    fields: [
      number('inspection.goal.coverage', 'Coverage', PERCENT, '95', {help: 'Of the measurable surface.'}),
      whole('inspection.goal.max_scans', 'Most scans', NONE, '40'),
      number('inspection.targets.spacing_m', 'Target spacing', MM, '5',
             {help: 'Between points to be measured.'}),
      number('inspection.targets.coverage_radius_m', 'Coverage radius', MM, '3',
             {help: 'A measured point this near counts.'}),
    ],
    more: [
      number('inspection.goal.max_time_s', 'Time limit of the search', S, 'none',
             {help: 'Such a plan does not repeat exactly.'}),
      number('inspection.goal.min_gain', 'Least gain of a scan', PERCENT, '0.02'),
      number('inspection.goal.execution_time_s', 'Longest time to execute', S, 'none'),
      whole('inspection.goal.max_setups', 'Most set-ups', NONE, 'none'),
      whole('inspection.goal.max_sensor_places', 'Most places of the sensors', NONE, 'none'),
      whole('inspection.goal.max_resting_faces', 'Most resting faces', NONE, 'none'),
      number('inspection.targets.max_normal_angle_deg', 'Largest angle to the normal', DEG, '30'),
      number('inspection.targets.max_pixel_footprint_m', 'Coarsest pixel on the part', MM, 'no limit'),
      number('inspection.targets.max_circle_of_confusion_px', 'Largest blur', PX, '2',
             {help: 'Needs pixel size, focal length, f-number; without them no limit.'}),
      number('inspection.targets.max_incidence_deg', 'Steepest surface', DEG, '70'),
      whole('inspection.targets.seed', 'Seed of the targets', NONE, '1'),
    ],
  },
  {
    id: 'tolerances', title: 'Tolerances', kinds: ['plan', 'evaluate', 'inspect'], closed: true,
    intro: 'To plan until the surface is known well enough, give a share here and leave the coverage empty.',
    fields: [
      number('inspection.goal.admissible', 'Share known well enough', PERCENT, 'not asked for'),
      number('inspection.tolerances.zone_width_m', 'Tolerance zone, full width', MM, 'not given'),
      number('inspection.uncertainty.line_detection.standard_deviation_px', 'Line detection, std. dev.', PX, '0.2'),
      number('inspection.uncertainty.resolution_m', 'Lateral resolution', MM, '3'),
      number('inspection.uncertainty.prior_standard_deviation_m', 'Form before any scan, std. dev.', MM, '10'),
      number('inspection.tolerances.guard_factor', 'Guard factor', NONE, '2'),
    ],
  },
  {
    id: 'costs', title: 'Time to execute', kinds: ['plan', 'evaluate', 'optics'], closed: true,
    intro: 'The plan takes the least time by these.',
    fields: [
      number('inspection.costs.stage_speed_m_per_s', 'Stage speed', MM_PER_S, '50'),
      number('inspection.costs.frame_rate_hz', 'Frame rate', {unit: 'Hz', exponent: 0}, 'by camera file'),
      number('inspection.costs.lay_time_s', 'Laying the part on a face', S, '180'),
      number('inspection.costs.turn_time_s', 'Turning the part', S, '60'),
      number('inspection.costs.move_sensors_time_s', 'Placing the sensors', S, '900',
             {help: '60 for a rigid sensor head.'}),
      number('inspection.costs.reposition_time_s', 'Repositioning, each', S, '0'),
      number('inspection.costs.reposition_speed_deg_per_s', 'Turning speed', {unit: 'deg/s', exponent: 0}, 'not given'),
      number('inspection.costs.reposition_speed_m_per_s', 'Shifting speed', MM_PER_S, 'not given'),
    ],
  },
  {
    id: 'search', title: 'Search', kinds: ['plan'], closed: true,
    fields: [
      {type: 'choice', path: 'plan_options.strategy', label: 'Strategy', ...NONE, fallback: 'refined',
       choices: ['refined', 'greedy-pso', 'greedy-pso-1', 'greedy-ga', 'greedy-sa', 'greedy-cmaes', 'greedy-de', 'matrix']},
      whole('plan_options.evaluations_per_scan', 'Evaluations per scan', NONE, '5000'),
      whole('plan_options.bound_evaluations', 'Effort of the lower bound', NONE, '100000', {help: '0: none.'}),
      whole('plan_options.starts', 'Starts', NONE, '1', {help: 'With so many seeds; the best plan is kept.'}),
      flag('plan_options.no_pictures', 'Leave the pictures out of the report'),
      flag('plan_options.no_point_clouds', 'Leave the point clouds out'),
    ],
  },
  {
    id: 'measured', title: 'Measured points', kinds: ['inspect'],
    fields: [
      {type: 'choice', path: 'inspect_options.measured_unit', label: 'Unit of PLY and PCD points', ...NONE,
       fallback: 'm', choices: ['m', 'cm', 'mm', 'um', 'inch']},
      number('inspect_options.tolerated_distance_m', 'Farthest from the part', MM, '2',
             {help: 'Of three quarters of the points of each file.'}),
      number('inspect_options.pose_prior_m', 'Place of the part, std. dev.', MM, '5'),
      number('inspect_options.pose_prior_deg', 'Turn of the part, std. dev.', DEG, '3'),
      flag('inspect_options.no_next_scan', 'Do not look for the next scan'),
    ],
  },
  {
    id: 'acceptance', title: 'Acceptance test', kinds: ['accept'],
    fields: [
      whole('inspection.acceptance.runs', 'Tests of every artefact', NONE, '200'),
      number('inspection.acceptance.sphere_diameter_m', 'Diameter of the sphere', MM, 'by the field'),
      number('inspection.acceptance.ball_bar_length_m', 'Length of the ball bar', MM, 'by the field'),
      number('inspection.acceptance.plate_side_m', 'Side of the plate', MM, 'by the field'),
      number('inspection.acceptance.ring_diameter_m', 'Diameter of the ring', MM, 'by the field'),
      flag('accept_options.no_images', 'Draw detection errors, render nothing'),
    ],
  },
  {
    id: 'optics_frames', title: 'Frames', kinds: ['optics'],
    intro: 'Empty: the frames that represent the scans.',
    fields: [
      whole('optics_options.scan', 'Scan', NONE, 'all', {help: 'From 1.'}),
      whole('optics_options.frame', 'Frame', NONE, 'all'),
      number('optics_options.stage_position_m', 'Stage position', MM, 'all'),
    ],
  },
  {
    id: 'render_frames', title: 'Images', kinds: ['render'],
    fields: [
      whole('render_options.frames.scan', 'Scan', NONE, 'all', {help: 'From 1.'}),
      whole('render_options.frames.frame', 'Frame', NONE, 'all'),
      number('render_options.frames.stage_position_m', 'Stage position', MM, 'all'),
      number('render_options.exposure_time_s', 'Exposure time', {unit: 'ms', exponent: -3}, 'as the inspection’s'),
      number('render_options.f_number', 'f-number of the images', NONE, 'as the inspection’s'),
      flag('render_options.layers', 'Also the layers as EXR'),
      flag('render_options.demosaic', 'Also colour images of colour sensors'),
      flag('render_options.no_speckle', 'Without speckle'),
      flag('render_options.tiff', 'TIFF instead of PNG'),
    ],
  },
  {
    id: 'diagnosis', title: 'Diagnosis', kinds: ['diagnose'],
    fields: [
      whole('diagnose_options.max_effects', 'Most effects at a time', NONE, '2'),
      {type: 'list', path: 'diagnose_options.excluded_effects', label: 'Effects not to consider', ...NONE,
       fallback: 'none', help: 'By id, with commas between.'},
      {type: 'text', path: 'diagnose_options.part_file', label: 'Mesh of the part', ...NONE, fallback: 'none',
       help: 'Name among the files; for recordings of a part.'},
      {type: 'choice', path: 'diagnose_options.part_unit', label: 'Unit of that mesh', ...NONE,
       fallback: 'as the file says', choices: ['m', 'cm', 'mm', 'um', 'inch']},
    ],
  },
  {
    id: 'common', title: 'Name, seed and plan',
    fields: [
      {type: 'text', path: 'inspection.name', label: 'Name of the inspection', ...NONE,
       fallback: 'none', kinds: PLANNING, wide: true},
      whole('seed', 'Seed', NONE, '1', {help: 'Same task, same seed, same results.'}),
      flag('other_part', 'Take a plan that states another part', {kinds: ['evaluate', 'inspect', 'optics', 'render']}),
    ],
  },
];

export const FIELDS = SECTIONS.flatMap((section) => [...section.fields, ...(section.more ?? [])]);
export const FIELD_BY_PATH = new Map(FIELDS.map((field) => [field.path, field]));

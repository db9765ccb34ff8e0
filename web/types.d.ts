// What the daemon says (docs/api.md), for the type check of the pages.
// The rule: only what the pages read; the daemon may say more.

export type Axes = Record<string, number>;

export interface Alarm {
  code: number | null;
  axis: string | null;
  message: string;
}

/** Who moves a machine by hand. */
export interface Holder {
  name: string;
  client: string;
  since: string;
}

export interface State {
  status: string;
  position: { machine: Axes; work: Axes };
  feed: number | null;
  spindle: number | null;
  overrides: Record<string, number>;
  alarm: Alarm | null;
  absolute: boolean | null;
  tool: number | null;
  tool_requested: number | null;
  inputs: Record<string, boolean>;
  accessories?: string[];
  homed?: boolean | null;
  pendant?: boolean;
  substate?: number | null;
  ack_s?: number | null;
  batch_s?: number | null;
  control?: Holder | null;
  seq: number;
  at: string | null;
}

export interface Machine {
  name: string;
  protocol: string;
  port: string;
  link: string;
  capabilities: string[];
  travel?: Record<string, number[]>;
  state: State;
  active_job: number | null;
  queue_length: number;
  link_stats: { epoch?: number; retries?: number; errors?: Record<string, number> };
}

export interface Progress {
  line: number;
  lines: number;
  acknowledged_lines: number;
  sent_line: number;
  seconds_elapsed: number | null;
  seconds_left: number | null;
  seconds_left_min: number | null;
  seconds_left_max: number | null;
}

export interface Job {
  id: number;
  status: string;
  program: string;
  program_name: string;
  source_program: string | null;
  machine: string;
  progress: Progress;
  error: { code: string; message: string; line_from: number | null; line_to: number | null } | null;
  tool: number | null;
  hold: boolean;
  hold_reason: { code: string; message: string } | null;
  cancelling: boolean;
  note: string | null;
  mode: string;
  on_error: string | null;
  start_line: number;
  end_line: number;
  rerun_of: number | null;
  created_at: string;
  started_at: string | null;
  ended_at: string | null;
}

export interface Waiting {
  id: number;
  program_name: string;
  hold: boolean;
  hold_reason?: { code: string; message: string } | null;
}

export interface Message {
  seq: number;
  type: string;
  machine: string | null;
  at: string;
  data: any;
}

export interface LogLine {
  at: string;
  machine: string | null;
  level: string;
  text: string;
}

export interface World {
  order: string[];
  machines: Record<string, Machine>;
  jobs: Record<number, Job>;
  queues: Record<string, Waiting[]>;
  log: LogLine[];
  programsChanged: number;
  problem: string | null;
}

export interface Program {
  id: string;
  name: string;
  lines: number;
  bytes: number;
  created_at: string;
  source_program: string | null;
}

export interface Setting {
  number: number;
  value: string;
  name: string | null;
  unit: string | null;
  min: number | null;
  max: number | null;
  meaning: string | null;
  kind: "bool" | "mask" | "integer" | "number" | "text" | null;
  bits: { bit: number; name: string; on: boolean | null }[];
}

export interface Pin {
  name: string;
  type: "bit" | "s32";
  direction: "in" | "out";
  value: boolean | number;
  since: string;
  valid: boolean;
  drivable: boolean;
}

export interface Io {
  kind: string;
  state: string;
  estop: string;
  connected: boolean;
  tool: number | null;
  prepared: number | null;
  faulted: boolean;
  parameters: Record<string, number>;
  waiting_for: string | null;
  waiting_tool: number | null;
  overdue: boolean;
  may_confirm: boolean;
  may_fail: boolean;
  may_clear_fault: boolean;
  refusal: string | null;
  pins: Pin[];
}

export interface Finding {
  line: number;
  column: number;
  code: string;
  message: string;
  count: number;
}

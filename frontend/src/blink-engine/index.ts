/** Living eyelids for avatars: the twin of the Python package `blink_engine`. */
export { BlinkEngine, type EngineOptions, type LidFrame } from "./engine";
export type { Law } from "./parameters";
export {
  type BlinkEvent,
  DEFAULT_PARAMETERS,
  type Drift,
  type EventKind,
  meanInterval_s,
  type Parameters,
  type ProfileModel,
  type Response,
  SOURCES,
  STATE_NAMES,
  type StateName,
  withRate,
} from "./parameters";

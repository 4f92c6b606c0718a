/** The page's own sentences. Every other language file has the same keys, or does not compile. */
import type { Message, Plural } from "../message";

export const messages = {
  continue: "Continue",
  try_again: "Try again",
  start_study: "Start",
  preview_note: "Preview: these answers are deleted later.",
  minutes: "About {minutes} min",
  choose_language: "Language",
  step: "Step {step} of {steps}",

  consent_agree: "I have read this and agree to take part",
  consent_needed: "Please tick the box, or choose ‘I do not agree’.",
  consent_decline: "I do not agree",
  declined_title: "You are not taking part",
  declined: "The study ends here. No answers have been stored. You can close this page.",
  saving: "Saving …",
  saving_busy: "The server is busy at the moment. Your answers are safe on this device and will be sent as soon as it has time.",
  saving_offline: "There is no connection at the moment. Your answers are safe on this device and will be sent as soon as it is back.",
  not_saved: "The server did not accept this: {message}",

  form_required: "required",
  form_missing: "Please answer this question.",
  form_number: "Please enter a whole number from {minimum} to {maximum}.",
  form_length: { by: "maximum", one: "Please use at most {maximum} character.", other: "Please use at most {maximum} characters." },
  form_fix: "Please look at the marked questions.",

  screen_title: "Your screen",
  full_screen_text:
    "The clips are shown in full screen, so that nothing else is moving beside them. You can leave it at any time with Esc.",
  full_screen_enter: "Go to full screen",
  full_screen_again_title: "Full screen, please",
  full_screen_again: "The window has left full screen. Please go back to go on.",
  full_screen_denied: "This browser does not allow full screen. Please make the window as large as you can.",
  window_small_title: "The window is too small",
  window_small:
    "This study needs a window of at least {width} by {height} pixels; yours has {have_width} by {have_height}. Make it larger, turn the device, or set the zoom to 100% (Ctrl and 0).",

  card_title: "How large is your screen?",
  card_text:
    "The clips are shown at their real size. Hold a bank card (or any card of that size) against the screen. Make the picture exactly as large as the card.",
  card_why:
    "Why: screens differ, and only by a card does yours show them at that size. Nothing of the card is read or stored.",
  card_picture: "A hand holds a bank card flat against the screen, over the drawn card.",
  size_round: "Measurement {round} of {times}",
  size_again: "Once more, from another size: two measurements tell how exact the size is.",
  size_differs: "The two sizes differ by {percent}%. Please measure once more.",
  recheck_title: "Is the size still right?",
  recheck_differs: "This size differs from the earlier one by {percent}%. Please measure anew.",
  card_slider: "Size of the card on the screen",
  card_smaller: "Smaller",
  card_larger: "Larger",
  card_untouched: "Hold a card against the screen and change the drawn one until both are as large.",
  size_implausible: "By this size your screen would be {width} cm wide. Please measure once more.",
  card_fits: "It fits",
  card_none: "I have no card: use a ruler",
  card_hint: "Drag the slider, use the arrow keys, or pull the card's corner.",
  ruler_title: "Measure this line",
  ruler_text: "Hold a ruler against the screen. How long is the line, from end mark to end mark?",
  ruler_length: "Length in millimetres",
  ruler_none: "I have no ruler",
  ruler_check_title: "A quick check",
  ruler_check_text: "If a ruler is at hand, measure this line. It should be {length} mm long.",
  ruler_ok: "It is, within 2 mm",
  ruler_differs: "It is not",
  ruler_bad: "Please enter the length in millimetres, from {minimum} to {maximum}.",
  use_card: "Use a bank card",
  clip_too_large_title: "The clip does not fit",
  clip_too_large:
    "At its real size the clip needs {width} pixels, and this window offers {have}. Please use a larger screen or window, or measure again.",
  measure_again: "Measure again",
  skip: "Skip",
  screen_changed_title: "Your screen has changed",
  screen_changed: "The page is on another screen, or the screen was set up anew. Please measure again, so that the size is right.",

  distance_title: "How far away do you sit?",
  distance_text: {
    by: "times",
    one: "Sit as you will during the study. Cover your right eye with your hand. With the left eye, look at the square and do not look away. Press Space or the button when the dot disappears. We do this {times} time.",
    other:
      "Sit as you will during the study. Cover your right eye with your hand. With the left eye, look at the square and do not look away. Press Space or the button when the dot disappears. We do this {times} times.",
  },
  distance_start: "Start (Space)",
  distance_gone: "The dot is gone (Space)",
  distance_round: "{round} of {times}",
  distance_type: "Enter the distance instead",
  distance_cm: "Distance from your eyes to the screen, in centimetres",
  distance_bad: "Please enter a distance from {minimum} to {maximum} cm.",
  distance_missed: "That round does not count. Keep looking at the square, and press Space or the button as soon as the dot disappears.",

  preload_title: "Getting the clips",
  preload_text: "They are loaded beforehand, so that each one runs smoothly.",
  preload_progress: { by: "total", one: "{done} of {total} clip", other: "{done} of {total} clips" },
  preload_failed_title: "Some clips could not be loaded",
  preload_failed:
    "The connection seems to be interrupted. What you have done so far is kept. Try again, or come back later with the same link.",
  preload_without: "Go on without these clips",

  practice_title: "Practice",
  practice_note: "Practice {number} of {total}",
  practice_ahead: "Practice clips: {trials}. These answers do not count.",
  practice_done_title: "That was the practice",
  practice_done: {
    by: "trials",
    one: "From now on your answers count. There is {trials} clip.",
    other: "From now on your answers count. There are {trials} clips.",
  },
  practice_parts: "They come in parts of about {block}, with breaks between them.",
  feedback_good: "Good: that is how it works.",
  feedback_key: "You pressed a key while the clip was running. Watch it to the end; the scale appears then.",
  feedback_focus: "The page was left while the clip was running. Please stay on the page.",
  feedback_slow: {
    by: "seconds",
    one: "You took {seconds} second. Answer by your first impression.",
    other: "You took {seconds} seconds. Answer by your first impression.",
  },

  feedback_again: "Please try this one once more.",

  ready: "Press Space to start the clip",
  ready_again: "Press Space to see it again ({view} of {views})",
  ready_again_touch: "Tap to see it again ({view} of {views})",
  ready_touch: "Tap to start the clip",
  ready_replay: "This clip did not run smoothly before. Here it is once more.",
  start: "Start",
  decoding: "Preparing the clip …",
  trial_of: "{number} of {total}",
  clip_name: "The clip",
  already_seen: "You have already seen this clip. Please answer now.",
  clip_playing: "The clip is running.",
  clip_broken_title: "This clip cannot be shown",
  clip_broken: "It is not your fault, and we have taken note of it. Please go on with the next one.",
  rating_key: "{value} of {maximum}",
  pair_ready: "Press Space to start both clips",
  pair_ready_touch: "Tap to start both clips",
  pair_replay: "These clips did not run smoothly before. Here they are once more.",
  pair_name: "The two clips",
  pair_left: "Left",
  pair_right: "Right",
  pair_upper: "Upper",
  pair_lower: "Lower",
  pair_first: "First",
  pair_second: "Second",
  slider_untouched: "no answer yet",
  confirm: "Confirm",
  comment: "Comment (if you like)",
  attention_title: "One question in between",

  break_progress: { by: "total", one: "{done} of {total} clip done", other: "{done} of {total} clips done" },
  break_part: "Part {block} of {blocks} comes next",
  break_wait: "You can go on in {seconds} s.",
  break_ready: "You can go on whenever you like.",
  break_go_on: "Go on",
  welcome_back_title: "Welcome back",
  welcome_back: "You go on where you stopped. Clips done: {done} of {total}.",

  finishing_title: "Saving your last answers",
  finishing_wait: {
    by: "count",
    one: "{count} answer is still to be sent. Please keep this page open.",
    other: "{count} answers are still to be sent. Please keep this page open.",
  },
  done_code: "Your completion code",
  out_code: "Your code",
  done_copy: "Copy",
  done_copied: "Copied",
  done_return: "Go back to where you signed up",
  done_close: "Everything is saved. You can close this page.",
  return_begun: "Somebody has begun this study on this device. If that was you, go on where you stopped.",
  return_go_on: "That was me: go on",
  new_visit: "Another person takes part on this device",

  stop: "Stop",
  stop_title: "Do you want to stop?",
  stop_later: "Pause: I will come back with the same link",
  stop_withdraw: "Withdraw from the study",
  stop_continue: "Go on with the study",
  paused_title: "See you later",
  paused: "Everything so far is saved. Open the same link, on this device, to go on where you stopped.",
  withdrawn_title: "You have withdrawn",
  withdrawn: "The study ends here. Thank you for the time you gave. You can close this page.",
  screened_out_title: "Thank you",
  screened_out: "By your answers this study is not meant for you. Thank you for your time.",
  close: "You can close this page.",
  no_device: "I have no larger screen or window",

  second_tab_title: "The study is open in another tab",
  second_tab: "It can run in one place only. Go on in the other tab, or take over here.",
  second_tab_take: "Go on here",
  taken_over_title: "The study goes on in another tab",
  taken_over: "You can close this one. Nothing is lost.",
  taken_over_device: "The study was continued in another place, with the same link. To go on here, load the page again.",
  reload: "Load the page again",

  link_unknown_title: "This link is not known",
  link_unknown: "Please check that you have copied all of it, or ask the person who invited you.",
  link_closed: "This study is not open at the moment. Please ask the person who invited you.",
  link_expired: "This link has expired. Please ask the person who invited you for a new one.",
  link_full: "This study has all the participants it needs. Thank you for your interest.",
  link_paused: "This study is paused. Please try again later.",
  link_used: "This link has been used already.",
  run_left:
    "This study must be done in one go, and your visit was interrupted, so it cannot be continued. Please ask the person who invited you.",
  run_too_old: "Your visit began too long ago to be continued. Please ask the person who invited you.",
  link_title: "You cannot take part now",

  no_answer_title: "The server cannot be reached",
  no_answer: "Please check your connection. The page tries again by itself every few seconds.",
  busy_title: "The study is busy at the moment",
  busy: "The server is there, but it cannot get at its data just now. The page tries again by itself every few seconds.",
  problem_title: "Something went wrong",
  problem:
    "What you have done so far is kept. Load the page again; if this comes back, please write to the person who invited you: {detail}",

  resume_note:
    "Resume code: {code}. Note it down: it lets you continue on another device, or if this browser forgets you. The link or your sign-up number alone is not enough, so that nobody else can take over your visit.",
  code_open: "I have a resume code",
  code_title: "Go on where you stopped",
  code_needed:
    "A visit under your sign-up has begun in another browser. Go on there, or enter the resume code that it showed. We ask because others may know your sign-up number.",
  code_over: "A visit under your sign-up is over. Its resume code shows the last page again.",
  code_enter: "Enter the code that the page showed with the instructions, in the breaks and when you paused.",
  code_label: "Resume code",
  code_wrong: "No visit has this code. Please compare it with what you noted.",
  code_wait: "Too many tries. Please wait a minute.",
  code_back: "Back",
  code_anew: "I have no code: begin anew",

  gate_title: "The study cannot be shown here",
  gate_open_title: "Before you begin",
  gate_insecure:
    "The page was opened without a secure connection, and without one the browser cannot check the clips. Open the link with https:// at its beginning. If that does not work, tell the person who invited you.",
  gate_browser:
    "This browser cannot show clips frame by frame. Please open the link in a recent Chrome, Edge, Firefox or Safari, on a computer.",
  gate_video:
    "Your browser cannot decode the clips frame by frame, so they are played as an ordinary video. That works, but a recent Chrome, Edge or Firefox does it better.",
  gate_h264:
    "This browser seems to lack the H.264 decoder that most clips need. Please open the link in Chrome, Edge or Safari, or in Firefox with the codecs of your system installed. If you go on here, the clips may not be shown.",
  gate_screen:
    "The screen of this device is too small: the study needs {width} by {height} pixels, this one has {have_width} by {have_height}. Please use a computer or a larger tablet.",
  gate_zoom:
    "The page is enlarged, so that the clips would not fit: the study needs {width} by {height} pixels, and at this zoom there are {have_width} by {have_height}. Please set the zoom to 100% (Ctrl and 0).",
  gate_touch: "This study needs a keyboard. Please open the link on a computer.",
  gate_storage:
    "This browser does not let the page keep anything, perhaps because of a private window. You can go on, but each answer must reach the server before the next clip, so a good connection is needed. A normal window is better.",
  gate_continue: "Go on all the same",
};

type English = typeof messages;
/** What counts something in English has the forms of the language's own plural in every other one. */
export type Messages = { [Key in keyof English]: English[Key] extends string ? string : Plural };
/** Every language's own, whatever its plurals. */
export type AnyMessages = Record<keyof English, Message>;

// The websocket: events into the store, samples into the ring, the emergency stop out. It comes back by itself.
import { get, post } from "./api.js";
import { state, update, changed } from "./store.js";
import { say } from "./messages.js";
import { begin, connected, take } from "./stream.js";

const HISTORY_S = 30;
let socket = null;
let pause = 500;
let number = 0;
const awaited = new Map(); // stops without an answer yet
const fetches = { records: "/api/records", models: "/api/models", timeline: "/api/timeline", plans: "/api/plans" };

Object.assign(state, {
  online: false, hello: null, role: "watch", bench: {}, jobs: [], candidates: {}, log: [],
  records: [], models: [], timeline: { steps: [], can_undo: false }, plans: [], signals: [], stop: null,
});

/** Open the connection and keep it. */
export function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({ data }) => (typeof data === "string" ? receive(JSON.parse(data)) : take(data));
  socket.onclose = () => {
    update({ online: false });
    for (const answer of awaited.values()) answer(null);
    awaited.clear();
    setTimeout(connect, pause);
    pause = Math.min(5000, pause * 1.6);
  };
}

const handlers = {
  hello(event) {
    pause = 500;
    connected();
    update({ online: true, hello: event, role: event.role, bench: event.state });
    send({ type: "live", history: HISTORY_S });
    refreshAll();
  },
  state: (event) => update({ bench: { ...state.bench, ...event.state } }),
  stream: (event) => { begin(event); changed(); },
  job: (event) => takeJob(event.job),
  candidates: (event) => update({ candidates: { ...state.candidates, [event.job]: event.rows } }),
  stopped(event) {
    awaited.get(event.id)?.(event);
    awaited.delete(event.id);
  },
  log(event) {
    update({ log: [...state.log.slice(-199), event] });
    if (event.level === "error") say(event.text, "poor");
  },
  records: () => refresh("records"),
  models: () => refresh("models"),
  timeline: () => refresh("timeline"),
  plans: () => refresh("plans"),
};

function receive(event) {
  handlers[event.type]?.(event);
}

function takeJob(job) {
  const others = state.jobs.filter((one) => one.id !== job.id);
  const before = state.jobs.find((one) => one.id === job.id);
  update({ jobs: [job, ...others].sort((a, b) => b.created - a.created) });
  if (before?.phase !== job.phase) dispatchEvent(new CustomEvent("job-phase", { detail: job }));
}

/** Fetch one of the lists again. */
export async function refresh(list) {
  try {
    const answer = await get(fetches[list]);
    if (list === "timeline") update({ timeline: answer });
    else if (list === "plans") update({ plans: answer.plans, signals: answer.signals });
    else update({ [list]: answer[list] });
  } catch (error) {
    say(error.message, "poor");
  }
}

async function refreshAll() {
  const lists = Object.keys(fetches).map(refresh);
  const jobs = get("/api/jobs").then((answer) => update({ jobs: answer.jobs })).catch(() => {});
  await Promise.all([...lists, jobs]);
  update({ loaded: true });
}

function send(message) {
  if (socket?.readyState !== WebSocket.OPEN) return false;
  socket.send(JSON.stringify(message));
  return true;
}

/** Emergency stop, by whichever way is open; the answer and its time are shown. */
export async function emergencyStop() {
  const begun = performance.now();
  const id = ++number;
  update({ stop: { phase: "asked", at: Date.now() } });
  let answer = null;
  try {
    answer = send({ type: "stop", id })
      ? await new Promise((resolve) => { awaited.set(id, resolve); setTimeout(() => resolve(null), 1000); })
      : null;
    answer ??= await post("/api/stop");
  } catch (error) {
    answer = { ok: false, message: error.message };
  }
  const milliseconds = performance.now() - begun;
  update({ stop: { phase: answer.ok ? "done" : "failed", text: answer.message, milliseconds, at: Date.now() } });
  if (!answer.ok) say(`Emergency stop: ${answer.message || "no answer from the plant"}. Use the stop of the bench itself.`, "poor");
}

addEventListener("visibilitychange", () => {
  send(document.hidden ? { type: "live", off: true } : { type: "live", history: HISTORY_S });
});

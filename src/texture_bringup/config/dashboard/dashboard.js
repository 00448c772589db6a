// SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
// SPDX-License-Identifier: Apache-2.0
'use strict';

const RETRY_MS = 1000;
const SILENT_MS = 3000;
const FRAME_MS = 100;
const BARS = 6;
const NARROW = 500;
const CURVES = ['--accent', '--second', '--third'];
const AXIS = { left: 48, bottom: 18, top: 14 };
const MAX_FRAMES = 300; // of one exploration; a longer one is thinned to every second frame, again and again
const ENDED = ['idle', 'done', 'aborted'];
// An explorer that was killed does not lift.
const LOST = 'no data from the dashboard: the nodes may have ended, and the arm may continue to press: look at the robot';
// What is shown from a click until its answer.
const DOING = {
  explore: 'exploring …',
  stop: 'stopping …',
  add: 'adding …',
  record: 'starting or ending the recording …',
  tare: 'taring …',
  recover: 'freeing the arm …',
  check: 'checking the finger …',
  collect: 'collecting …',
};
// Nodes that were started again know nothing of a finger that was left on the surface.
const RESTARTED = 'the dashboard was started again, and the finger may still press: look at the robot; this stays until an exploration or `texture lift` succeeds';
const DASHBOARD = document.documentElement.dataset.dashboard;
const at = (id) => document.getElementById(id);
let replaying = null;
const kept = new Map(); // what was shown of each exploration that is listed: texts, every how many, how many came
let last = 0;
let live = false;
let answer = ['', false]; // to the last button, and whether it is bad
let unanswered = false; // that none came is what is shown
let asked = 0; // number of the last request
let answered = 0; // number of the last one that was answered
let stopped = 0; // number of the last stop
let foreign = ''; // the dashboard that has taken over this address
let run = ''; // of the dashboard: another after each start
let restarted = false; // and no finger was lifted since
let explorer = true; // whether it is there
let warning = ''; // of the nodes
let fault = ''; // of the last recording
let phase = '';
let stopping = false; // until the idle state says whether the finger was lifted
let newest = ''; // id of the last exploration
let curve = { id: '', points: [] };

const showBanner = () => {
  const taken = foreign && `this address now belongs to another dashboard (${foreign}): reload the page`;
  const now = [answer[0], answer[0].includes(warning) ? '' : warning, restarted && RESTARTED, fault];
  const text = (live ? now : [taken, LOST, answer[1] && answer[0]]).filter(Boolean).join(' · ');
  at('banner').textContent = text;
  at('banner').className = !live || answer[1] || warning || restarted || fault ? 'banner bad' : 'banner';
  at('banner').hidden = !text;
};
const say = (text, bad = false) => {
  answer = [text ?? '', bad];
  unanswered = false;
  showBanner();
};
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name);
const element = (kind, text, className = '') => {
  const made = document.createElement(kind);
  made.textContent = text;
  made.className = className;
  return made;
};

// Redraw a list only when what it shows has changed: a button under a finger must not vanish.
const fill = (parent, items, make) => {
  const key = JSON.stringify(items);
  if (parent.dataset.key === key) return;
  parent.dataset.key = key;
  parent.replaceChildren(...items.map(make));
};

const drawing = (id) => {
  const canvas = at(id);
  const scale = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = Number(canvas.dataset.height || (canvas.dataset.height = canvas.height));
  canvas.style.height = `${height}px`;
  if (canvas.width !== Math.round(width * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const pen = canvas.getContext('2d');
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.fillStyle = colour('--soft');
  pen.font = '12px system-ui, sans-serif';
  return { pen, width, height };
};

// A value of 1, 2 or 5 times a power of ten that divides a span into a handful of ticks.
const tickStep = (span) => {
  const power = 10 ** Math.floor(Math.log10(span / 4));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => span / step <= 5);
};

const ticks = (low, high) => {
  const step = tickStep(high - low || 1);
  const first = Math.ceil(low / step);
  return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, k) => (first + k) * step);
};

// Lines and numbers of both axes around a plot; `x` and `y` turn values into pixels.
function drawAxes({ pen, width, height }, { x, y, xTicks, yTicks, xUnit, yUnit }) {
  pen.strokeStyle = colour('--line');
  pen.lineWidth = 1;
  pen.beginPath();
  pen.textAlign = 'right';
  pen.textBaseline = 'middle';
  yTicks.forEach((value) => {
    pen.moveTo(AXIS.left, y(value));
    pen.lineTo(width, y(value));
    pen.fillText(`${Number(value.toPrecision(3))}`, AXIS.left - 6, y(value));
  });
  pen.textBaseline = 'alphabetic';
  xTicks.forEach((value, k) => {
    if (k === xTicks.length - 2 && width < NARROW) return; // no room next to the unit
    pen.textAlign = k === xTicks.length - 1 ? 'right' : 'center';
    pen.fillText(`${Number(value.toPrecision(3))}${k === xTicks.length - 1 ? ` ${xUnit}` : ''}`, x(value), height - 3);
  });
  pen.stroke();
  pen.textAlign = 'left';
  pen.fillText(yUnit, 0, 10);
}

// Range of the middle 96 % of the values with some room: a touch or a lift-off does not flatten the slide.
const robustRange = (values) => {
  const sorted = [...values].sort((one, other) => one - other);
  const low = sorted[Math.floor(0.02 * (sorted.length - 1))];
  const high = sorted[Math.ceil(0.98 * (sorted.length - 1))];
  const room = 0.15 * (high - low) || 1;
  return [low - room, high + room];
};

function drawSignal(signal) {
  const plot = drawing('signal');
  const { pen, width, height } = plot;
  at('signal-name').textContent = signal.sensor ? `${signal.sensor} ${signal.channel}` : 'no samples yet';
  const known = [...signal.low, ...signal.high].filter((value) => value !== null);
  if (!known.length) return;
  const [low, high] = robustRange(known);
  const base = height - AXIS.bottom;
  const y = (value) => base - ((Math.min(high, Math.max(low, value)) - low) / (high - low)) * (base - AXIS.top);
  const x = (seconds) => width + (seconds / signal.length_s) * (width - AXIS.left);
  const xTicks = ticks(-signal.length_s, 0);
  drawAxes(plot, { x, y, xTicks, yTicks: ticks(low, high), xUnit: 's', yUnit: signal.unit });
  pen.strokeStyle = colour('--accent');
  pen.lineWidth = Math.max(1, (width - AXIS.left) / signal.low.length);
  pen.beginPath();
  signal.low.forEach((value, k) => {
    if (value === null) return;
    const place = x(-signal.length_s * (1 - (k + 0.5) / signal.low.length));
    pen.moveTo(place, y(value) + 0.5);
    pen.lineTo(place, y(signal.high[k]) - 0.5);
  });
  pen.stroke();
}

function drawSpectrum(spectrum) {
  const plot = drawing('spectrum');
  const { pen, width, height } = plot;
  at('spectrum-name').textContent = spectrum.db.length ? 'amplitude of the newest half second' : '';
  if (!spectrum.db.length) return;
  const base = height - AXIS.bottom;
  const high = Math.max(...spectrum.db, -20);
  const low = high - 70;
  const y = (value) => base - (Math.max(0, value - low) / (high - low)) * (base - AXIS.top);
  const x = (hertz) => AXIS.left + (hertz / spectrum.high_hz) * (width - AXIS.left);
  drawAxes(plot, { x, y, xTicks: ticks(0, spectrum.high_hz), yTicks: ticks(low, high), xUnit: 'Hz', yUnit: 'dB' });
  const step = (width - AXIS.left) / spectrum.db.length;
  pen.fillStyle = colour('--accent');
  spectrum.db.forEach((value, k) => {
    pen.fillRect(AXIS.left + k * step, y(value), Math.max(1, step - 1), base - y(value));
  });
}

function drawTaxels(taxels) {
  const { pen, width, height } = drawing('taxels');
  const { values, places, unit } = taxels;
  if (!values.length) {
    at('taxel-range').textContent = 'this sensor has no slow channels';
    return;
  }
  const most = Math.max(1e-9, taxels.least_range ?? 0, ...values.map((value) => Math.abs(value ?? 0)));
  at('taxel-range').textContent = `relative to the level before contact, ±${most.toPrecision(3)} ${unit}`;
  const rows = 1 + Math.max(...places.map((place) => place[0]));
  const columns = 1 + Math.max(...places.map((place) => place[1]));
  const side = Math.min(width / columns, height / rows);
  const left = (width - side * columns) / 2;
  values.forEach((value, k) => {
    const fraction = Math.abs(value ?? 0) / most;
    pen.fillStyle = value === null ? colour('--line') : `color-mix(in srgb, ${value < 0 ? '#e8590c' : '#1098ad'} ${Math.round(100 * fraction)}%, ${colour('--back')})`;
    pen.fillRect(left + places[k][1] * side, places[k][0] * side, side - 2, side - 2);
  });
}

function showState(state) {
  at('phase').textContent = state.phase;
  at('phase').className = `phase ${ENDED.includes(state.phase) ? state.phase : 'moving'}`;
  at('progress').value = state.progress ?? 0;
  at('speed').textContent = state.speed ?? '–';
  at('force').textContent = state.force ?? '–';
  at('motion-now').textContent = state.motion || '–';
}

// The probabilities of the exploration that is shown, by the sliding time that they rest on.
function noteCurve(texture) {
  const newest = curve.points.length ? curve.points[curve.points.length - 1].seconds : 0;
  if (texture.exploration_id !== curve.id || texture.evidence_s < newest) curve = { id: texture.exploration_id, points: [] };
  if (!texture.labels.length || (curve.points.length && texture.evidence_s === newest)) return;
  const probabilities = Object.fromEntries(texture.labels.map((label, k) => [label, texture.probabilities[k]]));
  curve.points.push({ seconds: texture.evidence_s, probabilities, decided: texture.decided });
}

function drawCurve() {
  const plot = drawing('curve');
  const { pen, width, height } = plot;
  const { points } = curve;
  const base = height - AXIS.bottom;
  const longest = Math.max(1, points.length ? points[points.length - 1].seconds : 0);
  const x = (seconds) => AXIS.left + (seconds / longest) * (width - AXIS.left - 4);
  const y = (probability) => base - probability * (base - AXIS.top);
  drawAxes(plot, { x, y, xTicks: ticks(0, longest), yTicks: [0, 0.25, 0.5, 0.75, 1], xUnit: 's', yUnit: '' });
  if (points.length < 2 && ENDED.includes(phase)) pen.fillText('shown for slides while the page is open', AXIS.left + 8, y(0.5));
  if (points.length < 2) return;
  const last = points[points.length - 1].probabilities;
  const leading = Object.keys(last).sort((one, other) => last[other] - last[one]).slice(0, CURVES.length);
  leading.forEach((label, k) => {
    pen.strokeStyle = pen.fillStyle = colour(CURVES[k]);
    pen.lineWidth = k ? 1.5 : 2.5;
    pen.beginPath();
    points.forEach((point, n) => pen[n ? 'lineTo' : 'moveTo'](x(point.seconds), y(point.probabilities[label] ?? 0)));
    pen.stroke();
    pen.fillText(label, AXIS.left + 8, y(0.5) + 16 * (k - 1));  // where lines are least often
  });
  const decided = points.find((point) => point.decided);
  if (!decided) return;
  pen.fillStyle = colour('--ink');
  pen.beginPath();
  pen.arc(x(decided.seconds), y(decided.probabilities[leading[0]] ?? 0), 5, 0, 2 * Math.PI);
  pen.fill();
  const right = x(decided.seconds) > width - 70;
  pen.textAlign = right ? 'right' : 'left';
  pen.fillText('decided', x(decided.seconds) + (right ? -9 : 9), y(decided.probabilities[leading[0]] ?? 0) + 16);
}

function showTexture(texture) {
  noteCurve(texture);
  drawCurve();
  at('label').textContent = texture.shown;
  at('label').dataset.final = texture.final;
  at('estimate-note').textContent = texture.note;
  const advice = texture.label ? texture.message : '';
  at('advice').hidden = !advice;
  at('advice').querySelector('summary').textContent = texture.accepted ? 'Advice' : 'Why';
  at('advice').querySelector('p').textContent = advice;
  const bars = texture.labels.slice(0, BARS).map((label, k) => [label, texture.probabilities[k]]);
  fill(at('evidence'), bars, ([label, probability]) => {
    const bar = element('div', '', 'bar');
    const meter = document.createElement('meter');
    meter.value = probability;
    bar.append(element('span', label), meter, element('span', probability.toFixed(2)));
    return bar;
  });
}

function showRoughness(roughness) {
  if (roughness.model) at('roughness').hidden = false;
  const fraction = roughness.valid ? Math.min(1, Math.max(0, (roughness.grade - 1) / 4)) : 0;
  at('gauge-arc').style.strokeDasharray = `${100 * fraction} 100`;
  at('grade').textContent = roughness.shown;
  at('roughness-note').textContent = roughness.note;
}

function showFrame(frame) {
  drawSignal(frame.signal);
  drawSpectrum(frame.spectrum);
  drawTaxels(frame.taxels);
  showState(frame.state);
  showTexture(frame.texture);
  showRoughness(frame.roughness);
}

function showRest(frame) {
  phase = frame.state.phase;
  ({ warning, fault } = frame);
  restarted = restarted && !frame.state.lifted;
  const there = frame.lights.some((light) => light.name === 'explorer' && light.there);
  if (there && !explorer && answered === asked) say(''); // what was answered is of an earlier one
  explorer = there;
  showBanner();
  if (stopping && phase === 'idle') {
    stopping = false;
    say(frame.state.lifted ? 'stopped; the finger is lifted' : 'stopped; the finger was not lifted: look at the robot', !frame.state.lifted);
  }
  newest = frame.past.length ? frame.past[0].id : '';
  fill(at('lights'), frame.lights, (light) => element('li', `${light.name}: ${light.message}`, light.colour));
  at('record').textContent = frame.recording ? 'End recording' : 'Record';
  at('record').dataset.on = frame.recording ? 'yes' : '';
  at('recording').textContent = frame.recording;
  at('working').textContent = frame.working;
  [...kept.keys()].filter((id) => !frame.past.some((item) => item.id === id)).forEach((id) => kept.delete(id));
  const past = frame.past.map((item) => ({ ...item, kept: kept.has(item.id) }));
  fill(at('past'), past, (item) => {
    const row = element('li', '');
    const button = element('button', 'Replay');
    button.hidden = !item.kept;
    button.addEventListener('click', () => replay(item.id));
    row.append(element('span', item.text), button);
    return row;
  });
}

// Keep what is shown of an exploration while it goes on.
function keep({ exploration_id: id, phase }, text) {
  if (!id || ENDED.includes(phase)) return;
  const frames = kept.get(id) || { texts: [], stride: 1, seen: 0 };
  if (frames.seen % frames.stride === 0) frames.texts.push(text);
  frames.seen += 1;
  if (frames.texts.length > MAX_FRAMES) {
    frames.texts = frames.texts.filter((_, number) => number % 2 === 0);
    frames.stride *= 2;
  }
  kept.set(id, frames);
}

function replay(id) {
  const { texts, stride } = kept.get(id);
  window.clearInterval(replaying);
  let k = 0;
  say(`replaying ${id}`);
  window.scrollTo({ top: 0, behavior: 'smooth' });
  replaying = window.setInterval(() => {
    if (k < texts.length) {
      showFrame(JSON.parse(texts[k]));
      k += 1;
      return;
    }
    window.clearInterval(replaying);
    replaying = null;
    say(`replayed ${id}`);
  }, FRAME_MS * stride);
}

async function ask(name, body) {
  const moving = phase && !ENDED.includes(phase);
  const number = ++asked;
  if (name === 'stop') stopped = number;
  else stopping = false;
  say(body.undo ? 'removing the slide that was added last …' : DOING[name]);
  try {
    const answer = await fetch(`api/${name}?dashboard=${encodeURIComponent(DASHBOARD)}`, {
      method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(body),
    });
    const reply = await answer.json();
    answered = Math.max(answered, number);
    if (number < stopped) return; // the answer to the stop stays
    if (name === 'stop') stopping = moving && reply.success;
    say(reply.message, !reply.success && !reply.stopped);
  } catch (error) {
    if (number < answered) return; // a later request was answered since
    say(`'${name}' got no answer: ${error.message}`, true);
    unanswered = true;
  }
}

async function loadMotions() {
  const motions = await (await fetch('api/motions')).json();
  if (!Object.keys(motions).length) return void window.setTimeout(loadMotions, RETRY_MS); // no explorer yet
  const chosen = at('motion').value;
  at('motion').replaceChildren(...Object.keys(motions).map((name) => element('option', name)));
  at('motion').value = chosen in motions ? chosen : Object.keys(motions)[0];
  const offer = () => fill(at('numbers'), motions[at('motion').value], numberField); // typed ones stay
  at('motion').onchange = offer;
  offer();
}

function numberField(number) {
  const label = element('label', number.text);
  const input = document.createElement('input');
  Object.assign(input, { type: 'number', step: 'any', min: number.low, max: number.high, value: number.default, required: true, name: number.name });
  label.append(input);
  return label;
}

function connect() {
  const socket = new WebSocket(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/ws`);
  socket.onmessage = (message) => {
    const frame = JSON.parse(message.data);
    if (frame.dashboard) return void greet(socket, frame);
    last = Date.now();
    live = true;
    keep(frame.state, message.data);
    if (replaying === null) showFrame(frame);
    showRest(frame);
  };
  socket.onclose = () => {
    showLost();
    if (!foreign) window.setTimeout(connect, RETRY_MS);
  };
}

// The first message: whose dashboard it is, and whether it was started again since the last connection.
function greet(socket, hello) {
  if (hello.dashboard !== DASHBOARD) {
    foreign = hello.dashboard;
    document.querySelectorAll('button').forEach((button) => { button.disabled = true; });
    return void socket.close();
  }
  restarted = restarted || (run !== '' && run !== hello.run);
  run = hello.run;
  if (unanswered) say(''); // from now on the state is known
  loadMotions().catch(() => say('the list of motions did not arrive; reload the page', true));
}

// What was shown last is no longer known: no number, and no green node.
function showLost() {
  live = false;
  showBanner();
  window.clearInterval(replaying);
  replaying = null;
  showState({ phase: 'not connected' });
  ['label', 'grade'].forEach((id) => { at(id).textContent = '–'; });
  at('estimate-note').textContent = '';
  at('phase').className = 'phase aborted';
  fill(at('lights'), [], element);
}

at('explore').addEventListener('submit', (event) => {
  event.preventDefault();
  const numbers = [...at('numbers').querySelectorAll('input')].map((input) => [input.name, Number(input.value)]);
  window.clearInterval(replaying);
  replaying = null;
  ask('explore', {
    motion: at('motion').value, ...Object.fromEntries(numbers), direction_rad: Number(at('direction').value) * Math.PI / 180,
    surface: at('surface').value.trim(), early_stopping: at('early').checked,
  });
});
at('learn').addEventListener('submit', (event) => {
  event.preventDefault();
  ask('add', { label: at('texture').value.trim(), id: newest });
});
at('stop').addEventListener('click', () => ask('stop', {}));
at('undo').addEventListener('click', () => ask('add', { undo: true }));
at('collect').addEventListener('submit', (event) => {
  event.preventDefault();
  ask('collect', { surface: at('collected').value.trim() });
});
document.querySelectorAll('[data-ask]').forEach((button) => button.addEventListener('click', () => ask(button.dataset.ask, {})));
at('record').addEventListener('click', () => ask('record', { on: !at('record').dataset.on }));
window.setInterval(() => {
  if (Date.now() - last > SILENT_MS) showLost();
}, SILENT_MS);
connect();

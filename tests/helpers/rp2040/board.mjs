// An RP2040 with two converters: IMAGE BAUD. rp2040js has the processor, the UART, the clocks and the PIO of one core;
// here are the second core, the FIFOs between both, the boot ROM of core 1, the rate of the PIO and its joined queues.
//
// Commands are lines "CYCLES BYTES"; so many cycles of the system are played, in which the bytes (hexadecimal, or "-")
// arrive at the UART, ten bits each. The answer is "SENT WORDS LOST APART": what the UART sent, the words that x and y
// took as their selects rose, 8 digits for both, how many bytes came to a full FIFO, and how many words of an axis
// were taken at another time than those of the other one.
import { readFileSync, readSync, writeSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";

const require = createRequire(join(process.cwd(), "node_modules", "rp2040js", "index.js"));
const { RP2040, LogLevel, ConsoleLogger } = require("rp2040js");
const { CortexM0Core } = require(join(process.cwd(), "node_modules/rp2040js/dist/cjs/cortex-m0-core.js"));
const { FIFO } = require(join(process.cwd(), "node_modules/rp2040js/dist/cjs/utils/fifo.js"));

const [image, baud] = [readFileSync(process.argv[2]), Number(process.argv[3])];
const RAM = 0x20000000;
const CYCLES_PER_BYTE = (125e6 * 10) / baud;
const ECHOED = 8; // words that a FIFO between the cores holds
const [FIFO_ST, FIFO_WR, FIFO_RD] = [0x50, 0x54, 0x58]; // of SIO
const JOIN_TX = 1 << 30; // SHIFTCTRL
const SAMPLE_PINS = [{ data: 2, clock: 3, select: 4 }, { data: 5, clock: 6, select: 7 }];

const chip = new RP2040();
chip.logger = new ConsoleLogger(LogLevel.Error, true);
chip.sram.set(image);
const cores = [chip.core, new CortexM0Core(chip)];
cores[0].PC = RAM; // where the boot ROM enters an image that it has put into RAM
let core1Runs = false;

// Between the cores: what core 0 writes, the boot ROM of core 1 echoes, until it has its vectors, stack and entry.
const toCore0 = [];
const handshake = [];
function bootCore1(word) {
  const at = handshake.length;
  const expected = [0, 0, 1][at];
  if (at < 3 && word !== expected) handshake.length = 0;
  else handshake.push(word);
  if (toCore0.length < ECHOED) toCore0.push(word);
  if (handshake.length < 6) return;
  const [, , , vectors, stack, entry] = handshake;
  cores[1].VTOR = vectors;
  cores[1].SP = stack;
  cores[1].PC = entry & ~1;
  cores[1].cycles = cores[0].cycles;
  core1Runs = true;
}
const sioRead = chip.sio.readUint32.bind(chip.sio);
const sioWrite = chip.sio.writeUint32.bind(chip.sio);
chip.sio.readUint32 = (offset) => {
  if (offset === FIFO_ST) return (toCore0.length ? 1 : 0) | 2;
  if (offset === FIFO_RD) return toCore0.shift() ?? 0;
  return sioRead(offset);
};
chip.sio.writeUint32 = (offset, value) => {
  if (offset !== FIFO_WR) return sioWrite(offset, value);
  if (core1Runs) throw new Error("core 1 has left its boot ROM");
  bootCore1(value >>> 0);
  cores[0].eventRegistered = true;
  cores[0].waiting = false;
};

// The PIO: rp2040js plays it between cycles of nothing, and with queues of 4.
const pio = chip.pio[0];
pio.run = () => {};
const machines = pio.machines.slice(0, 2);
const pioWrite = pio.writeUint32.bind(pio);
pio.writeUint32 = (offset, value) => {
  pioWrite(offset, value);
  for (const machine of machines)
    if (machine.shiftCtrl & JOIN_TX && machine.txFIFO.size === 4) machine.txFIFO = new FIFO(8);
};
let words = "";
let apart = 0;
const taken = [[], []];
const shifted = [0, 0];
const bits = [0, 0];
let pinsBefore = 0;
const hex = (value, digits) => (value >>> 0).toString(16).padStart(digits, "0");
function playPio() {
  const enabled = machines.filter((machine) => machine.enabled);
  if (!enabled.length) return;
  for (const machine of enabled) machine.step();
  const pins = pio.pinValues;
  const rose = pins & ~pinsBefore;
  pinsBefore = pins;
  let took = 0;
  SAMPLE_PINS.forEach(({ data, clock, select }, axis) => {
    if ((rose >> clock) & 1) {
      shifted[axis] = ((shifted[axis] << 1) | ((pins >> data) & 1)) & 0xffff;
      bits[axis]++;
    }
    if ((rose >> select) & 1 && bits[axis]) {
      for (const pin of [data, clock, select])
        if (!chip.gpio[pin].outputEnable) throw new Error(`pin ${pin} is no output of the PIO`);
      if (bits[axis] !== 16) throw new Error(`${bits[axis]} bits were shifted`);
      bits[axis] = 0;
      took |= 1 << axis;
      taken[axis].push(hex(shifted[axis], 4));
    }
  });
  if (took === 1 || took === 2) apart++;
  while (taken[0].length && taken[1].length) words += taken[0].shift() + taken[1].shift();
}

// The UART, and time.
const uart = chip.uart[0];
let sent = "";
uart.onByte = (byte) => (sent += hex(byte, 2));
const arriving = [];
let nextByte = 0;
let lost = 0;
let nextPio = 0;
let end = 0;
function play(until) {
  for (;;) {
    const now = core1Runs ? Math.min(cores[0].cycles, cores[1].cycles) : cores[0].cycles;
    while (nextPio <= now) {
      playPio();
      nextPio += machines[0].clockDivInt || 1;
    }
    chip.core = cores[0]; // it has the interrupt of the UART
    while (arriving.length && nextByte <= now) {
      if (uart.rxFIFO.full) lost++;
      uart.feedByte(arriving.shift());
      nextByte += CYCLES_PER_BYTE;
    }
    if (now >= until) return;
    const core = core1Runs && cores[1].cycles < cores[0].cycles ? cores[1] : cores[0];
    chip.core = core;
    if (core.waiting) core.cycles++;
    else core.executeInstruction();
  }
}

const buffer = Buffer.alloc(1 << 16);
let text = "";
for (;;) {
  const count = readSync(0, buffer);
  if (!count) break;
  text += buffer.toString("ascii", 0, count);
  const lines = text.split("\n");
  text = lines.pop();
  for (const line of lines) {
    const [cycles, bytes] = line.split(" ");
    if (bytes !== "-") {
      if (!arriving.length) nextByte = Math.max(nextByte, end) + CYCLES_PER_BYTE;
      arriving.push(...Buffer.from(bytes, "hex"));
    }
    end += Number(cycles);
    play(end);
    writeSync(1, `${sent || "-"} ${words || "-"} ${lost} ${apart}\n`);
    sent = words = "";
  }
}

// A variable: its terms as curves with handles, its value as a slider, and the terms' numbers as fields.
export default {
  template: `
  <section class="variable" :aria-label="kind + ' ' + variable.name">
    <div class="variable-head">
      <h3>{{ variable.name }} <span v-if="variable.unit">{{ variable.unit }}</span></h3>
      <output v-if="shown !== null">{{ short(shown) }} {{ variable.unit }}</output>
    </div>
    <p class="about" v-if="variable.description">{{ variable.description }}</p>
    <div class="names" aria-hidden="true">
      <b v-for="term in variable.terms" :style="{ left: share(term.middle) + '%', color: term.colour }">{{ term.name }}</b>
    </div>
    <div class="plot" ref="plot" v-if="variable.has_sets">
      <svg viewBox="0 0 1000 100" preserveAspectRatio="none" aria-hidden="true">
        <line x1="0" x2="1000" y1="50" y2="50" class="half" />
        <path v-for="(term, n) in variable.terms" class="under" :d="term.path + ' L1000 100 L0 100Z'" :style="{ fill: term.colour, fillOpacity: 0.05 + 0.3 * (degrees[n] || 0) }" />
        <path v-for="term in variable.terms" :d="term.path" :style="{ stroke: term.colour }" />
      </svg>
      <i class="here" v-if="shown !== null" :style="{ left: share(shown) + '%' }"></i>
      <template v-for="term in variable.terms">
        <button v-for="handle in term.handles" :key="term.name + handle.key" class="handle" role="slider" type="button"
          :class="{ out: handle.x < variable.minimum || handle.x > variable.maximum }"
          :style="{ left: share(handle.x) + '%', top: 100 - 100 * handle.y + '%', background: term.colour }"
          :title="term.name + ', ' + handle.label + ': ' + short(handle.value)"
          :aria-label="term.name + ', ' + handle.label" :aria-valuenow="handle.value" :aria-valuetext="short(handle.value) + ' ' + variable.unit"
          @pointerdown="grab($event, term, handle)" @keydown="nudge($event, term, handle)"></button>
      </template>
    </div>
    <input v-if="kind === 'input'" type="range" class="value" :min="variable.minimum" :max="variable.maximum" :step="span / 200"
      :value="value" :aria-label="variable.name + ', value'" :aria-valuetext="short(value) + ' ' + variable.unit" @input="slide" />
    <div class="ends" aria-hidden="true"><span>{{ short(variable.minimum) }}</span><span>{{ short(variable.maximum) }}</span></div>
    <details>
      <summary>numbers</summary>
      <div class="wide"><table>
        <tr v-for="term in variable.terms" :key="term.name">
          <td><input type="text" class="name" v-shows="term.name" :aria-label="'name of ' + term.name" @change="say('rename', { term: term.name, name: $event.target.value }, $event.target, term.name)" /></td>
          <td><select v-if="variable.has_sets" :value="term.shape" :aria-label="'shape of ' + term.name" @change="say('reshape', { term: term.name, shape: $event.target.value })">
            <option v-for="shape in variable.shapes" :value="shape">{{ shape.replaceAll('_', ' ') }}</option>
            <option v-if="!variable.shapes.includes(term.shape)" :value="term.shape">{{ term.shape }}</option></select></td>
          <td><label v-for="number in term.numbers" :key="number.key"><span>{{ number.label }}</span>
            <input type="text" inputmode="decimal" v-shows="number.value" :aria-label="term.name + ', ' + number.label" @change="typed($event, term, number)" /></label></td>
          <td><button type="button" class="quiet" :aria-label="'remove ' + term.name" @click="say('remove', { term: term.name })">✕</button></td>
        </tr>
      </table></div>
      <button type="button" class="quiet" @click="say('add', {})">+ term</button>
    </details>
  </section>`,
  props: { variable: Object, kind: String, start: Number },
  directives: {
    // an answer that comes while somebody types leaves the text alone
    shows: {
      mounted(field, { value }) {
        field.value = value;
        for (const [name, is] of [["input", true], ["change", false], ["blur", false]]) field.addEventListener(name, () => (field.isTyped = is));
      },
      updated(field, { value }) { if (!field.isTyped) field.value = value; },
    },
  },
  data() {
    return { value: this.start, degrees: [], answer: null, gesture: 0 };
  },
  computed: {
    span() { return this.variable.maximum - this.variable.minimum; },
    shown() { return this.kind === "input" ? this.value : this.answer; },
  },
  methods: {
    share(x) { return Math.min(100, Math.max(0, (100 * (x - this.variable.minimum)) / this.span)); },
    short(x) { return Math.abs(x) < 1e-9 * this.span ? "0" : String(Number(Number(x).toPrecision(4))); },
    // the answer of an inference: degrees of the terms and, of an output, its value
    infer(degrees, answer) { [this.degrees, this.answer] = [degrees, answer]; },
    set(value) { this.value = value; },
    slide(event) {
      this.value = Number(event.target.value);
      this.$emit("slide", { value: this.value });
    },
    // what is refused leaves the old text in its field
    say(what, told, field, old) {
      this.$emit("touch", { what, gesture: ++this.gesture, ...told });
      if (field) field.value = old;
    },
    typed(event, term, number) {
      this.say("number", { term: term.name, key: number.key, value: event.target.value }, event.target, number.value);
    },
    move(term, handle, value, gesture) {
      this.$emit("touch", { what: "drag", term: term.name, key: handle.key, value, gesture });
    },
    nudge(event, term, handle) {
      const steps = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 };
      if (!(event.key in steps)) return;
      event.preventDefault();
      const step = (this.span / (event.shiftKey ? 1000 : 100)) * steps[event.key];
      this.move(term, handle, handle.value + step, "keys " + term.name + handle.key);
    },
    // a message a frame, and one at the end; the whole drag is one change to undo
    grab(event, term, handle) {
      event.preventDefault();
      const knob = event.currentTarget, box = this.$refs.plot.getBoundingClientRect(), gesture = ++this.gesture;
      const from = handle.x - handle.value, first = event.clientX;
      let next = null, frame = 0;
      const send = () => { frame = 0; if (next !== null) this.move(term, handle, next, gesture); };
      const follow = (at) => {
        const x = Math.min(1.5, Math.max(-0.5, (at.clientX - box.left) / box.width));
        next = this.variable.minimum + x * this.span - from;
        if (Math.abs(at.clientX - first) > 1 && !frame) frame = requestAnimationFrame(send);
      };
      const end = () => {
        knob.removeEventListener("pointermove", follow);
        knob.removeEventListener("pointerup", end);
        knob.removeEventListener("pointercancel", end);
      };
      knob.focus();
      knob.setPointerCapture(event.pointerId);
      knob.addEventListener("pointermove", follow);
      knob.addEventListener("pointerup", end);
      knob.addEventListener("pointercancel", end);
    },
  },
};

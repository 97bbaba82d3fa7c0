// The rules as tables; a press on a term turns it to the next one.
export default {
  template: `
  <div class="rules" v-memo="[tables, strengths, selected]">
    <div class="wide" v-for="table in tables"><table :class="table.kind">
      <caption v-if="table.title">where {{ table.title }}</caption>
      <thead><tr><th v-for="head in table.heads" scope="col">{{ head }}</th></tr></thead>
      <tbody><tr v-for="row in table.rows" :class="{ selected: row.rule === selected }">
        <th scope="row">
          <button v-if="'rule' in row" type="button" class="quiet" :aria-label="row.head" :aria-pressed="row.rule === selected"
            @click="select(row.rule)">{{ row.rule + 1 }}</button>
          <template v-else>{{ row.head }}</template>
        </th>
        <td v-for="cell in row.cells" :colspan="cell.span">
          {{ cell.words }}
          <button v-for="one in cell.terms" type="button" class="term" :class="one.kind" :style="{ '--tone': one.tone }" :aria-label="one.label"
            @click="turn($event, one)" @keydown="turn($event, one)" @focus="select(one.rule)">
            {{ one.words }}<i v-if="one.side === 'then'" :style="{ width: 100 * (strengths[one.rule] || 0) + '%' }"></i></button>
        </td>
      </tr></tbody>
    </table></div>
  </div>`,
  data() {
    return { tables: [], strengths: [], selected: null };
  },
  methods: {
    show(tables) { this.tables = Object.freeze(tables); },
    fire(strengths) { this.strengths = strengths; },
    select(rule) { this.selected = rule; this.$emit("select", { rule }); },
    turn(event, { rule, side, index }) {
      const step = { click: event.shiftKey ? -1 : 1, ArrowDown: -1, ArrowUp: 1 }[event.key || event.type];
      if (!step) return;
      event.preventDefault();
      if (rule !== this.selected) this.select(rule);
      this.$emit("turn", { rule, side, index, step });
    },
  },
};

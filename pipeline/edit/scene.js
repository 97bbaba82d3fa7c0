// A flight in three dimensions, and its path as the controller that was opened flew it.
import { recordedFlight } from "flight-view/recorded.js";
import { FlightView } from "flight-view/view.js";

const INTERVAL_MS = 120; // between two tellings of the time
const KEY = '<div class="paths"><b class="now"></b>now <b class="before"></b>as opened <span class="limits"></span></div>';

class Scene extends FlightView {
  say(sample) {
    super.say(sample);
    this.onTime(sample);
  }
}

export default {
  template: '<div v-html="frame"></div>',
  props: { frame: String },
  mounted() {
    this.$el.querySelector(".frame").insertAdjacentHTML("beforeend", KEY);
    this.told = 0;
  },
  methods: {
    // the arrays of a flight, see `flight_table` in pipeline/report/scene.py, and the positions of the other
    show(table, before) {
      const flight = { ...recordedFlight(table), before, reasons: () => [] };
      this.$el.querySelector(".key").hidden = !flight.points.length;
      const limits = this.$el.querySelector(".limits");
      limits.hidden = !flight.limits.length;
      limits.textContent = `limits ${flight.limits.join(", ")} m`;
      if (this.view) this.view.replace(flight);
      else {
        this.view = new Scene(this.$el.querySelector(".scene"), flight, { onTime: sample => this.tell(sample) });
        this.view.show(0);
      }
    },
    tell(sample) {
      if (this.waiting || sample === this.told) return;
      this.waiting = setTimeout(() => {
        this.waiting = null;
        this.told = this.view.sample;
        this.$emit("time", { sample: this.told });
      }, INTERVAL_MS);
    },
  },
};

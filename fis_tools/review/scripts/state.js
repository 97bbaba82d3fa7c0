// The point in input space that a system's views show together.

class SystemState {
  constructor(system) {
    this.system = system;
    this.inputs = system.inputs.map(({ minimum, maximum }) => (minimum + maximum) / 2);
    this.listeners = [];
    this.told = oncePerFrame(() => this.listeners.forEach((listener) => listener(this)));
    this.inferred = null;
  }

  /** All steps of the inference at the present inputs. */
  get inference() {
    this.inferred ??= infer(this.system, this.inputs);
    return this.inferred;
  }

  setInput(place, value) {
    this.setInputs(this.inputs.with(place, value));
  }

  setInputs(inputs) {
    this.inputs = [...inputs];
    this.inferred = null;
    this.told();
  }

  /** Call the listener now and after every change. */
  follow(listener) {
    this.listeners.push(listener);
    listener(this);
  }
}

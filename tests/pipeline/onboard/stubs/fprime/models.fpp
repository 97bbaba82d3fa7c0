# Those of F Prime's models that the component uses: names and types.
module Fw {
  type Time
  type TlmBuffer
  port Time(ref $time: Fw.Time)
  port Tlm($id: U32, ref timeTag: Fw.Time, ref val: Fw.TlmBuffer)
}

module Svc {
  port Sched(context: U32)
}

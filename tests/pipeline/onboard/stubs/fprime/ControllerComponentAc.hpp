/* What the component's base class offers it; the autocoder's own needs all of F Prime. Answers are kept. */
#include "AnswerSerializableAc.hpp"
#include "ChangeAnswerSerializableAc.hpp"
#include "ChangeInputSerializableAc.hpp"
#include "StartInputSerializableAc.hpp"
#include "StepInputSerializableAc.hpp"
#include <string>

namespace Fw {
typedef std::string TlmString;
}

namespace Inspection {

class ControllerComponentBase {
  public:
    explicit ControllerComponentBase(const char *) {}
    virtual ~ControllerComponentBase() {}
    virtual void begin_handler(FwIndexType port, const StartInput &message) = 0;
    virtual void known_handler(FwIndexType port, const StepInput &message) = 0;
    virtual void run_handler(FwIndexType port, U32 context) = 0;
    virtual void change_handler(FwIndexType port, const ChangeInput &message) = 0;
    Answer fired;
    ChangeAnswer changed;
    std::string digests;

  protected:
    void fire_out(FwIndexType, const Answer &message) { fired = message; }
    void tlmWrite_Fired(const Answer &) {}
    void tlmWrite_Changed(const ChangeAnswer &message) { changed = message; }
    void tlmWrite_Code(const std::string &digest) { digests += digest; }
    void tlmWrite_Rules(const std::string &digest) { digests += digest; }
    void tlmWrite_Generator(const std::string &digest) { digests += digest; }
};

} // namespace Inspection

#include "studies/study.hpp"

namespace flexcomp::host {

const std::vector<StudyEntry>& studies() {
  static const std::vector<StudyEntry> all{
      {"fig2", "position errors by joint angle and by link length deviations, 1, 10 and 100 times Table 1",
       study_fig2},
      {"fig3", "accuracy of the geometric parameters by model size, without noise", study_fig3},
      {"fig4", "pose and position model, varied and settled orientation", study_fig4},
  };
  return all;
}

}  // namespace flexcomp::host

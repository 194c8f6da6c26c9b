// SPDX-License-Identifier: Apache-2.0
#include "studies/study.hpp"

namespace flexcomp::host {

const std::vector<StudyEntry>& studies() {
  static const std::vector<StudyEntry> all{
      {"fig2", "position errors by joint angle and by link length deviations, 1, 10 and 100 times Table 1",
       study_fig2},
      {"fig3", "accuracy of the geometric parameters by model size, without noise", study_fig3},
      {"fig4", "pose and position model, varied and settled orientation", study_fig4},
      {"fig8", "planned against DETMAX, M-LM against least squares, and set-ups with a higher limit",
       study_fig8},
      {"table3", "residuals on 30 other poses with three models, 14 planned poses", study_table3},
      {"poses", "score over the number of poses: is 14 the least?", study_poses},
      {"payload", "gain of the flexible model over the payload", study_payload},
  };
  return all;
}

}  // namespace flexcomp::host

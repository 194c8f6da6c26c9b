// SPDX-License-Identifier: Apache-2.0
/// \file
/// The studies of Chen et al. 2019: printed figure, our figure, and the Cramér-Rao limit.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "measurement/simulation.hpp"
#include "report/plots.hpp"
#include "studies/paper.hpp"

namespace flexcomp::host {

/// One result; fields without a value are empty.
struct StudyRow {
  std::vector<std::string> labels;   ///< one per name in Study::label_names
  std::optional<double> paper = {};  ///< printed figure
  std::optional<double> ours = {};
  std::optional<double> uncertainty = {};  ///< standard deviation of `ours`, a mean over repeats
  std::optional<double> limit = {};        ///< the Cramér-Rao limit of the same quantity
  std::string remark = {};
};

struct StudyFigure {
  std::string caption;
  Curves curves;
};

/// Result of a study.
struct Study {
  std::string name;      ///< fig4
  std::string title;     ///< subject
  std::string quantity;  ///< "score (1 is perfect)", "mean position error [mm]"
  std::vector<std::string> label_names;
  std::vector<StudyRow> rows = {};
  std::vector<std::string> notes = {};  ///< set-up, result, and limits of the printed figure
  std::vector<StudyFigure> figures = {};
};

struct StudyOptions {
  std::vector<StudiedArm> arms;
  std::vector<NoiseLevel> noises{noise_n1, noise_n2};
  std::size_t repeats = 500;
  std::uint64_t seed = 1;
  /// Called with the current task and the share of the work that is done; may be empty.
  std::function<void(const std::string&, double)> progress;

  void report(const std::string& what, double done) const {
    if (progress) progress(what, done);
  }
};

Study study_fig2(const StudyOptions& options);     ///< which deviations matter (Section 2.2)
Study study_fig3(const StudyOptions& options);     ///< models without noise (Section 2.3)
Study study_fig4(const StudyOptions& options);     ///< poses or positions, varied or settled (Section 3.1)
Study study_fig8(const StudyOptions& options);     ///< planning and estimator (Section 4)
Study study_table3(const StudyOptions& options);   ///< residuals of three models (Section 5)
Study study_poses(const StudyOptions& options);    ///< how many poses are needed
Study study_payload(const StudyOptions& options);  ///< effect of the payload

/// Entry of the list of studies.
struct StudyEntry {
  const char* name;
  const char* about;
  Study (*run)(const StudyOptions&);
};
const std::vector<StudyEntry>& studies();

}  // namespace flexcomp::host

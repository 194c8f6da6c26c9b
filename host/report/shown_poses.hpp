// SPDX-License-Identifier: Apache-2.0
/// \file
/// Which of very many poses are drawn.
#ifndef FLEXCOMP_HOST_REPORT_SHOWN_POSES_HPP
#define FLEXCOMP_HOST_REPORT_SHOWN_POSES_HPP

#include <cstddef>
#include <vector>

#include "report/page.hpp"

namespace flexcomp::host {

/// All, where they are at most `limit`. Else as many as that: the twentieth part with the largest errors after, as many
/// with the largest before, and of the others every n-th. Ascending.
std::vector<std::size_t> shown_poses(const std::vector<PagePose>& poses, std::size_t limit);

/// The same by the sizes themselves: a twentieth part by each list.
/// \param sizes  as many numbers each
std::vector<std::size_t> shown_rows(const std::vector<const std::vector<double>*>& sizes, std::size_t limit);

/// Which of `count` things in a row are drawn: all, or `most` evenly spaced ones.
std::vector<std::size_t> evenly_spaced(std::size_t count, std::size_t most);

}  // namespace flexcomp::host

#endif

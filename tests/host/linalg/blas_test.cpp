// SPDX-License-Identifier: Apache-2.0
// The large products of the diagnosis by BLAS: right, and the same from several threads at once as from one. (OpenBLAS
// without threads is not safe to call from several.)
#include "linalg/blas.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <atomic>
#include <random>
#include <thread>
#include <vector>

namespace {

using namespace flexcomp::host;

Eigen::MatrixXd matrix(std::mt19937& random, Eigen::Index rows, Eigen::Index columns) {
  std::normal_distribution<double> normal;
  Eigen::MatrixXd m(rows, columns);
  for (Eigen::Index k = 0; k < m.size(); ++k) m.data()[k] = normal(random);
  return m;
}

TEST(Blas, AgreesWithEigen) {
  std::mt19937 random(1);
  const Eigen::MatrixXd a = matrix(random, 90, 23);
  const Eigen::MatrixXd b = matrix(random, 90, 11);
  const Eigen::MatrixXd c = matrix(random, 23, 7);
  EXPECT_LT((transposed_product(a, b) - a.transpose() * b).norm(), 1e-11);
  EXPECT_LT((product(a, c) - a * c).norm(), 1e-11);
  EXPECT_LT((gram(a) - a.transpose() * a).norm(), 1e-11);
  Eigen::MatrixXd factor = gram(a);
  ASSERT_TRUE(factor_in_place(factor));
  Eigen::MatrixXd x = c;
  solve_lower(factor, x);
  solve_lower_transposed(factor, x);
  EXPECT_LT((gram(a) * x - c).norm(), 1e-9);
  Eigen::MatrixXd indefinite = -gram(a);
  EXPECT_FALSE(factor_in_place(indefinite));
}

TEST(Blas, IsTheSameFromSeveralThreadsAtOnce) {
  struct Work {
    Eigen::MatrixXd a, b, gram, across, down, solved;
  };
  std::mt19937 random(2);
  std::vector<Work> all;
  for (const Eigen::Index columns : {13, 37, 60, 200, 300}) {
    Work w;
    w.a = matrix(random, 540, columns);
    w.b = matrix(random, 540, 35);
    w.gram = gram(w.a);
    w.across = transposed_product(w.a, w.b);
    w.down = product(w.a, w.across);
    Eigen::MatrixXd factor = w.gram;
    w.solved = w.across;
    ASSERT_TRUE(factor_in_place(factor));
    solve_lower(factor, w.solved);
    solve_lower_transposed(factor, w.solved);
    all.push_back(std::move(w));
  }
  std::atomic<int> different{0};
  std::vector<std::thread> threads;
  for (unsigned seed = 0; seed < 4; ++seed) {
    threads.emplace_back([&all, &different, seed] {
      std::mt19937 order(seed);
      for (int k = 0; k < 200; ++k) {
        const Work& w = all[order() % all.size()];
        Eigen::MatrixXd factor = gram(w.a);
        if (factor != w.gram) ++different;
        Eigen::MatrixXd x = transposed_product(w.a, w.b);
        if (x != w.across) ++different;
        if (product(w.a, x) != w.down) ++different;
        if (!factor_in_place(factor)) ++different;
        solve_lower(factor, x);
        solve_lower_transposed(factor, x);
        if (x != w.solved) ++different;
      }
    });
  }
  for (std::thread& t : threads) t.join();
  EXPECT_EQ(different, 0);
}

}  // namespace

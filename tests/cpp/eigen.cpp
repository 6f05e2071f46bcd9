// vg.hpp with Eigen: poses of any storage order arrive row-major.
#include <Eigen/Geometry>

#include "vg_test.hpp"

#ifndef VG_HAS_EIGEN
#error "vg.hpp did not find Eigen"
#endif

namespace {

// No two numbers are equal, so that a transposition is noticed.
const Eigen::Quaterniond rotation = Eigen::Quaterniond(1, 2, 3, 4).normalized();
const Eigen::Vector3d position(5, 6, 7);

vg::Pose by_hand() {
    const Eigen::Matrix3d r = rotation.toRotationMatrix();
    return {r(0, 0), r(0, 1), r(0, 2), 5, r(1, 0), r(1, 1), r(1, 2), 6, r(2, 0), r(2, 1), r(2, 2), 7};
}

void poses_arrive_row_major() {
    Eigen::Isometry3d isometry = Eigen::Isometry3d::Identity();
    isometry.linear() = rotation.toRotationMatrix();
    isometry.translation() = position;
    const Eigen::Matrix4d columns = isometry.matrix();
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = columns;
    const Eigen::Matrix<double, 3, 4> top = columns.topRows<3>();
    const Eigen::Affine3d affine(columns);
    const Eigen::Matrix3d turned = rotation.toRotationMatrix();
    CHECK(vg::pose(isometry) == by_hand());
    CHECK(vg::pose(columns) == by_hand());
    CHECK(vg::pose(rows) == by_hand());
    CHECK(vg::pose(top) == by_hand());
    CHECK(vg::pose(columns.topRows<3>()) == by_hand());
    CHECK(vg::pose(affine) == by_hand());
    CHECK(vg::pose(turned, position) == by_hand());
    CHECK(vg::pose(rotation, position) == by_hand());
    CHECK(vg::pose(columns.cast<float>().eval())[3] > 4.9);

    const vg_camera camera = vg::pinhole(100, 100, 32, 32, 64, 64, vg::pose(isometry)).take();
    CHECK(vg::isometry(camera).isApprox(isometry, 1e-15));
    // The point (0, 0, 2) of the camera's frame, in the vehicle's frame.
    const Eigen::Vector3d point = isometry * Eigen::Vector3d(0, 0, 2);
    const auto pixel = vg::project(camera, {point.x(), point.y(), point.z()}).take();
    CHECK(pixel[0] > 32 - 1e-9 && pixel[0] < 32 + 1e-9 && pixel[1] > 32 - 1e-9 && pixel[1] < 32 + 1e-9);
}

void similarities_arrive_row_major() {
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    matrix.topLeftCorner<3, 3>() = 2 * rotation.toRotationMatrix();
    matrix.topRightCorner<3, 1>() = position;
    const vg::Similarity similarity = vg::similarity(matrix);
    const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> back(similarity.data());
    CHECK(back == matrix);
}

void arrays_are_matrices_that_are_not_copied() {
    const float positions[6] = {1, 2, 3, 4, 5, 6}, scales[6] = {1, 1, 1, 1, 1, 1},
                rotations[8] = {1, 0, 0, 0, 1, 0, 0, 0};
    const float opacities[2] = {0.5F, 1}, sh[6] = {};
    vg::GaussianArrays arrays;
    arrays.count = 2;
    arrays.positions = positions;
    arrays.scales = scales;
    arrays.rotations = rotations;
    arrays.opacities = opacities;
    arrays.sh = sh;
    const vg::Gaussians two = vg::Gaussians::from_arrays(arrays).take();
    const auto centres = vg::rows<3>(two.positions());
    CHECK(centres.rows() == 2 && centres.data() == two.positions().data());
    CHECK(centres.row(1).transpose() == Eigen::Vector3f(4, 5, 6));
    CHECK(vg::rows<1>(two.opacities()).sum() > 1.4F);
    CHECK(vg::rows<4>(two.rotations()).rows() == 2);
}

} // namespace

int main() {
    poses_arrive_row_major();
    similarities_arrive_row_major();
    arrays_are_matrices_that_are_not_copied();
    return 0;
}

// Pinocchio's rigid-body algorithms on CasADi symbols, as serialised CasADi functions.
//
// Python's wheels of Pinocchio have the headers for this, but no compiled module. The model arrives
// as numbers, and only the types of joints that the package uses are instantiated: both keep the
// time of compilation below a minute.

// A failed assertion would end Python without a message.
#define NDEBUG
// Pinocchio's visitors have more arguments than Boost's functions take by default, and ask for types
// of joints that are not among ours.
#define BOOST_FUSION_INVOKE_MAX_ARITY 12
#define BOOST_VARIANT_USE_RELAXED_GET_BY_DEFAULT

#include <pinocchio/autodiff/casadi.hpp>

#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/energy.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>

namespace {

using Symbol = casadi::SX;
using Vector = Eigen::Matrix<Symbol, Eigen::Dynamic, 1>;
using Vector3 = Eigen::Matrix<Symbol, 3, 1>;
using Matrix3 = Eigen::Matrix<Symbol, 3, 3>;
using Placement = pinocchio::SE3Tpl<Symbol>;
using RevoluteX = pinocchio::JointModelRevoluteTpl<Symbol, 0, 0>;
using RevoluteY = pinocchio::JointModelRevoluteTpl<Symbol, 0, 1>;
using RevoluteZ = pinocchio::JointModelRevoluteTpl<Symbol, 0, 2>;
using Revolute = pinocchio::JointModelRevoluteUnalignedTpl<Symbol, 0>;
using Prismatic = pinocchio::JointModelPrismaticUnalignedTpl<Symbol, 0>;
using Helical = pinocchio::JointModelHelicalUnalignedTpl<Symbol, 0>;

// The types of joints; those of aligned axes need fewer operations.
template <typename Scalar_, int Options_>
struct JointsTpl {
  using Scalar = Scalar_;
  static constexpr int Options = Options_;
  using JointModelVariant =
      boost::variant<RevoluteX, RevoluteY, RevoluteZ, Revolute, Prismatic, Helical>;
  using JointDataVariant =
      boost::variant<RevoluteX::JointDataDerived, RevoluteY::JointDataDerived,
                     RevoluteZ::JointDataDerived, Revolute::JointDataDerived,
                     Prismatic::JointDataDerived, Helical::JointDataDerived>;
};
using Model = pinocchio::ModelTpl<Symbol, 0, JointsTpl>;
using Data = pinocchio::DataTpl<Symbol, 0, JointsTpl>;

// The layout of the rows that library.py fills in. Matrices are stored by rows.
struct PlacementRow {
  double rotation[9], translation[3];
};
struct JointRow {
  double parent, turns, axis[3], pitch;  // turns: 0 for a prismatic joint; pitch in m/rad
  PlacementRow placement;
  double mass, lever[3], inertia[9];  // inertia about the centre of mass
};
struct FrameRow {
  double parent;
  PlacementRow placement;
};

Vector3 vector3(const double* values) {
  return Eigen::Map<const Eigen::Vector3d>(values).cast<Symbol>();
}

Matrix3 matrix3(const double* values) {
  using ByRows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  return Eigen::Map<const ByRows>(values).cast<Symbol>();
}

Placement placement(const PlacementRow& row) {
  return Placement(matrix3(row.rotation), vector3(row.translation));
}

Model::JointModel joint_model(const JointRow& row) {
  const Eigen::Map<const Eigen::Vector3d> axis(row.axis);
  if (!row.turns) return Prismatic(vector3(row.axis));
  if (row.pitch) return Helical(vector3(row.axis), Symbol(row.pitch));
  if (axis == Eigen::Vector3d::UnitX()) return RevoluteX();
  if (axis == Eigen::Vector3d::UnitY()) return RevoluteY();
  if (axis == Eigen::Vector3d::UnitZ()) return RevoluteZ();
  return Revolute(vector3(row.axis));
}

Model model_of(long count, const JointRow* rows, const FrameRow& frame, const double* gravity) {
  Model model;
  for (long index = 0; index < count; ++index) {
    const JointRow& row = rows[index];
    const auto joint = model.addJoint(static_cast<pinocchio::JointIndex>(row.parent),
                                      joint_model(row), placement(row.placement),
                                      "joint " + std::to_string(index + 1));
    model.inertias[joint] = pinocchio::InertiaTpl<Symbol>(
        Symbol(row.mass), vector3(row.lever),
        pinocchio::Symmetric3Tpl<Symbol>(matrix3(row.inertia)));
  }
  const auto parent = static_cast<pinocchio::JointIndex>(frame.parent);
  model.addFrame(pinocchio::FrameTpl<Symbol>("frame", parent, placement(frame.placement),
                                             pinocchio::OP_FRAME));
  model.gravity.linear() = vector3(gravity);
  return model;
}

Vector entries(const Symbol& symbols) {
  Vector result(symbols.numel());
  for (Eigen::Index row = 0; row < result.size(); ++row) result[row] = symbols(row);
  return result;
}

template <typename Matrix>
Symbol expression(const Matrix& matrix) {
  Symbol result(matrix.rows(), matrix.cols());
  for (Eigen::Index row = 0; row < matrix.rows(); ++row)
    for (Eigen::Index column = 0; column < matrix.cols(); ++column)
      result(row, column) = matrix(row, column);
  return result;
}

casadi::Function function_of(const std::string& quantity, const Model& model) {
  const Symbol q = Symbol::sym("q", model.nv);
  const Symbol v = Symbol::sym("v", model.nv);
  const Symbol a = Symbol::sym("a", model.nv);
  const Vector at = entries(q);
  Data data(model);
  if (quantity == "mass_matrix") {
    pinocchio::crba(model, data, at);
    return {quantity, {q}, {Symbol::triu2symm(Symbol::triu(expression(data.M)))}};
  }
  if (quantity == "kinetic_energy")
    return {quantity, {q, v}, {pinocchio::computeKineticEnergy(model, data, at, entries(v))}};
  if (quantity == "potential_energy")
    return {quantity, {q}, {pinocchio::computePotentialEnergy(model, data, at)}};
  if (quantity == "inverse_dynamics") {
    pinocchio::rnea(model, data, at, entries(v), entries(a));
    return {quantity, {q, v, a}, {expression(data.tau)}};
  }
  if (quantity == "frame_pose") {
    pinocchio::framesForwardKinematics(model, data, at);
    const Placement& pose = data.oMf.back();
    return {quantity, {q}, {expression(pose.rotation()), expression(pose.translation())}};
  }
  throw std::invalid_argument("unknown quantity " + quantity);
}

}  // namespace

// Returns a serialised function, or "error: " and a message. The caller releases the text.
extern "C" char* pinocchio_casadi(const char* quantity, long count, const JointRow* joints,
                                  const FrameRow* frame, const double* gravity) {
  std::string text;
  try {
    text = function_of(quantity, model_of(count, joints, *frame, gravity)).serialize();
  } catch (const std::exception& error) {
    text = std::string("error: ") + error.what();
  }
  return strdup(text.c_str());
}

extern "C" void pinocchio_casadi_release(char* text) { std::free(text); }

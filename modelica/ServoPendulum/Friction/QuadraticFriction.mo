within ServoPendulum.Friction;
model QuadraticFriction "Drag that grows with the square of the speed"
  extends Common.RotationalFriction.Quadratic(drag(max=2e-4));
  annotation (
    __Workbench(effect(
      size="drag", matters=2e-5, slots={"friction"}, after="ViscousFriction",
      separation="free swings from a greater height")),
    Documentation(info="<html>
<p>Air takes <code>cw*A*rho/2*l^3</code>, some 2e-6 N.m.s2/rad2 at the weight; a hundred times as much
leaves room for the fast stages of the gear.</p>
</html>"));
end QuadraticFriction;

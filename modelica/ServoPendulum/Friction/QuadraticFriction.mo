within ServoPendulum.Friction;
model QuadraticFriction "Drag that grows with the square of the speed"
  extends Common.RotationalFriction.Quadratic(drag(max=0.02));
  annotation (
    __Workbench(effect(
      size="drag", step=2e-4, matters=1e-4, slots={"friction"}, after="ViscousFriction",
      separation="free swings from a greater height")),
    Documentation(info="<html>
<p>Air at the weight takes about 1e-6 N.m.s2/rad2; churned grease may take more.</p>
</html>"));
end QuadraticFriction;

within Effects;
package RotationalFriction "What resists turning motion: the laws of Friction in rad/s and N.m"
  model Dry = Friction.Dry(coulomb(unit="N.m", quantity="Torque"),
    v0(unit="rad/s", quantity="AngularVelocity")) "Dry friction, after Coulomb";
  model Viscous = Friction.Viscous(damping(unit="N.m.s/rad")) "Viscous friction";
  model Stribeck = Friction.Stribeck(excess(unit="N.m", quantity="Torque"),
    vS(unit="rad/s", quantity="AngularVelocity"), v0(unit="rad/s", quantity="AngularVelocity"))
    "More friction close to standstill";
  model LoadDependent = Friction.LoadDependent(v0(unit="rad/s", quantity="AngularVelocity"))
    "Dry friction that grows with the load";
  model Quadratic = Friction.Quadratic(drag(unit="N.m.s2/rad2"))
    "Drag that grows with the square of the velocity";
  annotation (Documentation(info="<html>
<p>Laws, names of parameters and references are those of <code>Friction</code>; a slot is constrained
by <code>Interfaces.Friction</code> here, too.</p>
</html>"));
end RotationalFriction;

within WheelsetRig;
package Units "Types with SI units"
  type Length = Real(final quantity="Length", final unit="m");
  type Velocity = Real(final quantity="Velocity", final unit="m/s");
  type Angle = Real(final quantity="Angle", final unit="rad");
  type AngularVelocity = Real(final quantity="AngularVelocity", final unit="rad/s");
  type AngularAcceleration = Real(final quantity="AngularAcceleration", final unit="rad/s2");
  type Acceleration = Real(final quantity="Acceleration", final unit="m/s2");
  type Mass = Real(final quantity="Mass", final unit="kg", min=0);
  type Inertia = Real(final quantity="MomentOfInertia", final unit="kg.m2", min=0);
  type Force = Real(final quantity="Force", final unit="N");
  type Torque = Real(final quantity="Torque", final unit="N.m");
  type Stiffness = Real(final quantity="TranslationalSpringConstant", final unit="N/m", min=0);
  type Damping = Real(final quantity="TranslationalDampingConstant", final unit="N.s/m", min=0);
  type RotationalStiffness =
    Real(final quantity="RotationalSpringConstant", final unit="N.m/rad", min=0);
  type RotationalDamping =
    Real(final quantity="RotationalDampingConstant", final unit="N.m.s/rad", min=0);
  type Pressure = Real(final quantity="Pressure", final unit="Pa", displayUnit="bar");
  type Power = Real(final quantity="Power", final unit="W");
  type Energy = Real(final quantity="Energy", final unit="J");
  type Temperature =
    Real(final quantity="ThermodynamicTemperature", final unit="K", min=0);
  type FrictionCoefficient = Real(final quantity="CoefficientOfFriction", final unit="1", min=0);
  annotation (Documentation(info="<html>
<p>The library stands on its own: these types replace <code>Modelica.Units.SI</code>, with the
same quantities and units.</p>
</html>"));
end Units;

within ;
package Motor "A motor that turns an inertia"
  import Effects;

  model LateSpeed "a speed that is read late"
    extends Effects.Signals.Delay(window=2e-3, delay(min=-0.1, max=0.1));
    annotation (__Workbench(effect(
      size="delay", matters=5e-4, slots={"speedSensor"}, separation="a second sensor")));
  end LateSpeed;

  model Rubbing "viscous friction"
    extends Effects.RotationalFriction.Viscous(damping(max=1e-2));
    annotation (__Workbench(effect(
      size="damping", matters=3e-6, slots={"friction"}, separation="coasting")));
  end Rubbing;

  model Observer "Motor and inertia"
    parameter Real R(unit="Ohm", min=0.1) = 1.5 "Resistance";
    parameter Real L(unit="H") = 8e-3 "Inductance";
    parameter Real k(unit="V.s/rad") = 0.08 "Motor constant";
    parameter Real J(unit="kg.m2") = 2e-4 "Inertia";
    parameter Real tau(unit="N.m") = 0.0 "Load";
    input Real u(unit="V") "Voltage";
    input Real dtau(unit="N.m") "Correction of tau";
    output Real i(unit="A", start=0.0, fixed=true, nominal=5.0) "Current";
    output Real w(unit="rad/s", start=0.0, fixed=true, nominal=100.0) "Speed";
    output Real wRead(unit="rad/s") = speedSensor.y "Speed as read";
    replaceable Effects.Friction.Frictionless friction(v=w, load=0.0)
      constrainedby Effects.Interfaces.Friction(v=w, load=0.0) "Bearings";
    replaceable Effects.Signals.Unchanged speedSensor(u=w)
      constrainedby Effects.Interfaces.Signal(u=w) "From the speed to what is read";
  equation
    L*der(i) = u - R*i - k*w;
    J*der(w) = k*i - friction.f - (tau + dtau);
  end Observer;
  annotation (uses(Effects(version="1.0")));
end Motor;

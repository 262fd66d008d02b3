within WheelsetRig.Forces;
model WheelRollerContact "Elastic contact of one wheel on the roller, with creep force"
  extends Interfaces.PartialForce;
  parameter Units.Length rW "Wheel radius";
  parameter Units.Length rR "Roller radius";
  parameter Units.Force Q0(min=1000.0) "Wheel load at rest";
  parameter Units.Stiffness c(min=1e6) = 1.2e9 "Stiffness of the normal contact at rest";
  parameter Units.Damping d = 60000.0 "Damping of the normal contact at rest";
  parameter Contact.PolachParameters polach "Law of the creep force";
  parameter Units.Force QMin(min=1e-3) = 1.0 "Wheel load below which creep is smoothed";
  input Units.FrictionCoefficient mu0 "Friction at zero slip velocity";
  Interfaces.Flange roller "Rotation of the roller"
    annotation (Placement(transformation(extent={{-110,-60},{-90,-40}})));
  Interfaces.Flange wheel "Rotation of the wheel"
    annotation (Placement(transformation(extent={{90,-60},{110,-40}})));
  Units.Force Q "Wheel load, never negative";
  Units.Force F "Creep force; positive brakes the roller";
  Units.Velocity w "Slip velocity at this wheel";
  Units.Velocity v "Rolling velocity";
  Units.Power slipPower "Power of the creep force turned into heat";
protected
  parameter Units.Length h0 = 1.5*Q0/c "Penetration at rest";
  parameter Units.Length hMin = 1e-4*h0 "Penetration below which the wheel lifts off, smoothed";
  Units.Length e[3] "Wheel centre relative to the roller's axle";
  Units.Velocity de[3] "Its rate";
  Units.Length h "Penetration";
  Units.Length hContact "Penetration, never negative";
  Units.Force QElastic "Wheel load without damping";
  Units.Force QCreep "Wheel load, never zero";
equation
  e = frame_b.r_0 - frame_a.r_0;
  de = der(e);
  // The wheel at rest is pressed in by h0, but for the rounding at lift-off.
  h = rW + rR - e[3] + h0 - hMin^2/(4.0*h0);
  hContact = 0.5*(h + sqrt(h^2 + hMin^2));
  QElastic = Q0*(hContact/h0)^1.5;
  Q = QElastic*exp(-d/Q0*de[3]);
  QCreep = sqrt(Q^2 + QMin^2);
  v = rR*der(roller.phi);
  w = v - rW*der(wheel.phi) + de[1];
  F = Contact.creepForce(w, v, QCreep, Contact.kalkerStiffness(QCreep), mu0, polach);
  frame_b.f = {F, 0.0, -Q};
  frame_b.t = zeros(3);
  wheel.tau = -rW*F;
  roller.tau = rR*F;
  slipPower = F*w;
  energy = 0.4*Q0*h0*(hContact/h0)^2.5;
  lossPower = slipPower + (QElastic - Q)*de[3];
  annotation (Documentation(info="<html>
<p><code>frame_a</code> is the bearing of the roller, <code>frame_b</code> the centre of the wheel.
The normal force follows Hertz, <code>Q = Q0*(h/h0)^1.5</code>, with the penetration
<code>h0 = 1.5*Q0/c</code> at rest; damping multiplies it by <code>exp(-d/Q0*dz)</code>, which is
<code>Q - d*dz</code> for slow motion and keeps the force positive in fast separation. The creep
force takes the wheel load of the moment.</p>
<h4>Limits</h4>
<p>The wheel stays on the crest of the roller: the slope of the contact plane off the crest, 138 N
per mm at 80 kN, is neglected, and so are lateral creep and spin creepage. A wheel that has lifted
off keeps a creep force of at most <code>mu*QMin</code>.</p>
<h4>References</h4>
<p>K. L. Johnson (1985), <em>Contact Mechanics</em>, Cambridge, chapter 4; K. H. Hunt,
F. R. E. Crossley (1975), <em>Coefficient of restitution interpreted as damping in vibroimpact</em>,
Journal of Applied Mechanics 42, 440-445, for damping in proportion to the elastic force.</p>
</html>"));
end WheelRollerContact;

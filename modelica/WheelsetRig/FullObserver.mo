within WheelsetRig;
model FullObserver "Full observer model: frame bounce, brake unit pitch, wheelset and roller"
  parameter Units.Length rW(min=0.1) = 0.46 "Wheel radius";
  parameter Units.Length rR(min=0.1) = 0.70 "Roller radius";
  parameter Units.Length rB(min=0.1) = 0.30 "Radius at which the pads act";
  parameter Units.Inertia JW(min=1.0) = 110.0 "Inertia of the wheelset about its axle";
  parameter Units.Inertia JR(min=1.0) = 1500.0 "Inertia of the roller alone";
  parameter Units.Force Fz0(min=1000.0) = 80000.0 "Wheel load at rest";
  parameter Units.FrictionCoefficient muWR(min=0.01) = 0.15 "Friction wheel-rail at zero slip velocity";
  parameter Units.FrictionCoefficient muDC = 0.30 "Friction disc-pad";
  parameter Units.AngularVelocity omega0(min=1e-6) = 0.05 "Speed below which pad friction is smoothed";
  parameter Contact.PolachParameters polach "Law of the creep force";
  parameter Units.Mass mF(min=1.0) = 4000.0 "Mass of the bogie frame";
  parameter Units.Stiffness kF = 2.44e6 "Stiffness of the primary springs, both sides";
  parameter Units.Damping cF = 30000.0 "Damping of the primary springs, both sides";
  parameter Units.Mass mB = 110.0 "Mass of a brake unit";
  parameter Units.Inertia IB(min=0.1) = 8.0 "Inertia of a brake unit about its pivot";
  parameter Units.Length lB = 0.35 "From the pivot to the pads";
  parameter Units.Length lC = 0.0 "From the pivot to the centre of gravity of a brake unit";
  parameter Units.RotationalStiffness kB = 0.5e6 "Stiffness of the suspension of a brake unit";
  parameter Units.RotationalDamping cB = 160.0 "Damping of the suspension of a brake unit";
  parameter Units.Force QMin(min=1e-3) = 1.0 "Wheel load below which creep is smoothed";
  final parameter Integer nDiscs = 3 "Brake units, all on the side where the disc moves up";

  input Units.Pressure pB "Brake cylinder pressure";
  input Units.Torque tauR "Torque of the drive on the roller";
  input Real dmuWR(unit="1") "Correction of muWR";
  input Real dmuDC(unit="1") "Correction of muDC";
  input Units.AngularAcceleration correctionW "Correction added to der(omegaW)";
  input Units.AngularAcceleration correctionR "Correction added to der(omegaR)";

  output Units.AngularVelocity omegaW(start=0.0, fixed=true, nominal=50.0) "Angular velocity of the wheelset";
  output Units.AngularVelocity omegaR(start=0.0, fixed=true, nominal=50.0) "Angular velocity of the roller";
  output Units.Force Fx "Longitudinal creep force of both wheels";
  output Units.Velocity slip "Slip velocity";
  output Units.Force Fz "Wheel load";
  output Units.AngularVelocity omegaWReading = speedSensorW.y "Reading of speedSensorW";
  output Units.AngularVelocity omegaRReading = speedSensorR.y "Reading of speedSensorR";
  output Units.Force FxReading = forceSensor.y "Reading of forceSensor";
  Units.Length zF(start=0.0, fixed=true, nominal=0.01) "Bounce of the frame, from rest";
  Units.Velocity vF(start=0.0, fixed=true, nominal=0.1) "Bounce velocity of the frame";
  Units.Angle betaB(start=0.0, fixed=true, nominal=0.01) "Pitch of the brake units, pads up, from rest";
  Units.AngularVelocity omegaBeta(start=0.0, fixed=true) "Pitch velocity of the brake units";

  replaceable Brakes.LinearActuation actuation(pB=pB)
    constrainedby Brakes.PartialActuation(pB=pB) "Brake actuation";
  replaceable Brakes.ConstantPadFriction padFriction(
    level=muDC + dmuDC, Fperp=actuation.Fperp, v=vSlide)
    constrainedby Brakes.PartialPadFriction(
    level=muDC + dmuDC, Fperp=actuation.Fperp, v=vSlide) "Pad friction";
  replaceable Contact.ConstantAdhesion adhesion(
    level=muWR + dmuWR, w=slip, v=rR*omegaR, Fx=Fx/2.0)
    constrainedby Contact.PartialAdhesion(
    level=muWR + dmuWR, w=slip, v=rR*omegaR, Fx=Fx/2.0) "Contact friction";
  replaceable Losses.WheelsetLoss wheelsetLoss(omega=omegaW)
    constrainedby Losses.PartialLoss(omega=omegaW) "Bearings and discs of the wheelset";
  replaceable Losses.RollerLoss rollerLoss(omega=omegaR)
    constrainedby Losses.PartialLoss(omega=omegaR) "Bearings and windage of the roller";
  replaceable Sensors.IdealSpeedSensor speedSensorW(u=omegaW)
    constrainedby Sensors.PartialSpeedSensor(u=omegaW) "Speed sensor of the wheelset";
  replaceable Sensors.IdealSpeedSensor speedSensorR(u=omegaR)
    constrainedby Sensors.PartialSpeedSensor(u=omegaR) "Speed sensor of the roller";
  replaceable Sensors.IdealForceSensor forceSensor(u=Fx, Q=Q)
    constrainedby Sensors.PartialForceSensor(u=Fx, Q=Q) "Force sensor of the rig";

protected
  Units.Velocity vSlide "Velocity of the disc relative to the pads, upwards";
  Units.Force F "Friction force of one unit on its pads, upwards";
  Units.Force Q "Wheel load, never zero or negative";
equation
  slip = rR*omegaR - rW*omegaW;
  vSlide = rB*omegaW - (vF + lB*omegaBeta);
  F = padFriction.mu*actuation.Fperp*tanh(vSlide/(rB*omega0));
  Fz = Fz0 + 0.5*(nDiscs*F - kF*zF - cF*vF);
  // Half of (Fz + |Fz|), rounded at zero; exact to QMin^2/(4*Fz) in operation.
  Q = 0.5*(Fz + sqrt(Fz^2 + QMin^2));
  Fx = 2.0*Contact.creepForce(slip, rR*omegaR, Q, Contact.kalkerStiffness(Q), adhesion.mu0, polach);
  der(zF) = vF;
  der(betaB) = omegaBeta;
  (mF + nDiscs*mB)*der(vF) + nDiscs*mB*lC*der(omegaBeta) = nDiscs*F - cF*vF - kF*zF;
  IB*der(omegaBeta) + mB*lC*der(vF) = lB*F - cB*omegaBeta - kB*betaB;
  JW*der(omegaW) = rW*Fx - nDiscs*rB*F - wheelsetLoss.tau + JW*correctionW;
  JR*der(omegaR) = tauR - rR*Fx - rollerLoss.tau + JR*correctionR;
  annotation (
    experiment(StopTime=40.0, Tolerance=1e-6),
    Documentation(info="<html>
<p>Lagrange's equations of four coordinates: bounce of the bogie frame <code>zF</code>, pitch of the
brake units <code>betaB</code> (three units as one), wheelset and roller. Bounce and pitch act on the
angular velocities only through the wheel load and the sliding velocity of the pads. This is the
model of the parameter estimator, fed back through <code>dmuWR</code> and <code>dmuDC</code>.</p>
<h4>Slots</h4>
<p>As in <code>MinimalObserver</code>.</p>
<h4>References</h4>
<p>C. Schwarz, J. Brembeck, B. Heckmann (2018), equation (4) and Table 2.</p>
</html>"));
end FullObserver;

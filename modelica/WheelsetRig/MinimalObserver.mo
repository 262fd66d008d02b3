within WheelsetRig;
model MinimalObserver "Minimal observer model: wheelset and roller, two degrees of freedom"
  parameter Units.Length rW(min=0.1) = 0.46 "Wheel radius";
  parameter Units.Length rR(min=0.1) = 0.70 "Roller radius";
  parameter Units.Length rB(min=0.1) = 0.30 "Radius at which the pads act";
  parameter Units.Inertia JW(min=1.0) = 110.0 "Inertia of the wheelset about its axle";
  parameter Units.Inertia JR(min=1.0) = 1500.0 "Inertia of the roller alone";
  parameter Units.Force Fz(min=1000.0) = 80000.0 "Wheel load";
  parameter Units.FrictionCoefficient muWR(min=0.01) = 0.15 "Friction wheel-rail at zero slip velocity";
  parameter Units.FrictionCoefficient muDC = 0.30 "Friction disc-pad";
  parameter Units.Temperature TDisc = 333.15 "Temperature of the discs before the stop";
  parameter Units.AngularVelocity omega0(min=1e-6) = 0.05 "Speed below which pad friction is smoothed";
  parameter Contact.PolachParameters polach "Law of the creep force";
  final parameter Integer nDiscs = 3 "Brake discs on the axle";

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
  output Units.Velocity v = rollerRadius.y*omegaR "Speed of the roller's surface";
  output Units.Force Q = wheelLoad.y "Wheel load that acts";
  output Units.Force FDisc "Friction force of the disc that brakes least";
  output Units.AngularVelocity omegaWReading = speedSensorW.y "Reading of speedSensorW";
  output Units.AngularVelocity omegaRReading = speedSensorR.y "Reading of speedSensorR";
  output Units.Force FxReading = forceSensor.y "Reading of forceSensor";
  output Units.Pressure pBRest = cylinder.rest "Measured pressure of an empty cylinder";

  replaceable Brakes.DirectCylinder cylinder(pB=pB, restBefore=0.0)
    constrainedby Brakes.PartialCylinder(pB=pB, restBefore=0.0) "Brake cylinder and its sensor";
  replaceable Brakes.LinearActuation actuation(pB=cylinder.p)
    constrainedby Brakes.PartialActuation(pB=cylinder.p) "Brake actuation";
  replaceable Brakes.ConstantPadFriction padFriction(
    level=muDC + dmuDC, Fperp=actuation.Fperp, v=rB*omegaW, TBefore=TDisc)
    constrainedby Brakes.PartialPadFriction(
    level=muDC + dmuDC, Fperp=actuation.Fperp, v=rB*omegaW, TBefore=TDisc) "Pad friction";
  replaceable Contact.ConstantAdhesion adhesion(
    level=muWR + dmuWR, w=slip, v=v, Fx=Fx/2.0)
    constrainedby Contact.PartialAdhesion(
    level=muWR + dmuWR, w=slip, v=v, Fx=Fx/2.0) "Contact friction";
  replaceable Losses.WheelsetLoss wheelsetLoss(omega=omegaW)
    constrainedby Losses.PartialLoss(omega=omegaW) "Bearings and discs of the wheelset";
  replaceable Losses.RollerLoss rollerLoss(omega=omegaR)
    constrainedby Losses.PartialLoss(omega=omegaR) "Bearings and windage of the roller";
  replaceable Quantities.Unchanged wheelRadius(u=rW, omega=omegaW)
    constrainedby Quantities.PartialWheelRadius(u=rW, omega=omegaW) "Wheel radius";
  replaceable Quantities.Unchanged rollerRadius(u=rR, omega=omegaR)
    constrainedby Quantities.PartialRollerRadius(u=rR, omega=omegaR) "Roller radius";
  replaceable Quantities.Unchanged wheelLoad(u=Fz, omega=omegaW)
    constrainedby Quantities.PartialWheelLoad(u=Fz, omega=omegaW) "Wheel load";
  replaceable Quantities.Unchanged creepStiffness(
    u=Contact.kalkerStiffness(Q), omega=omegaW)
    constrainedby Quantities.PartialCreepStiffness(
    u=Contact.kalkerStiffness(Q), omega=omegaW)
    "Creep force per creepage at zero slip";
  replaceable Quantities.Unchanged wheelInertia(u=JW, omega=omegaW)
    constrainedby Quantities.PartialWheelInertia(u=JW, omega=omegaW) "Inertia of the wheelset";
  replaceable Quantities.Unchanged rollerInertia(u=JR, omega=omegaR)
    constrainedby Quantities.PartialRollerInertia(u=JR, omega=omegaR) "Inertia of the roller";
  replaceable Quantities.Unchanged driveTorque(u=tauR, omega=omegaW)
    constrainedby Quantities.PartialDriveTorque(u=tauR, omega=omegaW) "Torque of the drive";
  replaceable Sensors.IdealSpeedSensor speedSensorW(u=omegaW)
    constrainedby Sensors.PartialSpeedSensor(u=omegaW) "Speed sensor of the wheelset";
  replaceable Sensors.IdealSpeedSensor speedSensorR(u=omegaR)
    constrainedby Sensors.PartialSpeedSensor(u=omegaR) "Speed sensor of the roller";
  replaceable Sensors.IdealForceSensor forceSensor(u=Fx, Q=Q)
    constrainedby Sensors.PartialForceSensor(u=Fx, Q=Q) "Force sensor of the rig";

protected
  Units.Torque tauB "Torque of the pads on the wheelset";
equation
  slip = v - wheelRadius.y*omegaW;
  Fx = 2.0*Contact.creepForce(slip, v, Q, creepStiffness.y, adhesion.mu0, polach);
  tauB = nDiscs*padFriction.mu*actuation.Fperp*rB*tanh(omegaW/omega0);
  FDisc = (padFriction.mu - padFriction.lack)*actuation.Fperp*tanh(omegaW/omega0);
  wheelInertia.y*der(omegaW) =
    wheelRadius.y*Fx - tauB - wheelsetLoss.tau + wheelInertia.y*correctionW;
  rollerInertia.y*der(omegaR) =
    driveTorque.y - rollerRadius.y*Fx - rollerLoss.tau
    + rollerInertia.y*correctionR;
  annotation (
    experiment(StopTime=40.0, Tolerance=1e-6),
    Documentation(info="<html>
<p>Wheelset and roller as two rotating bodies, coupled by the creep force of both wheels. This is
the model of the disturbance observer; the friction corrections <code>dmuWR</code> and
<code>dmuDC</code> and the corrections of the state derivatives are what an observer feeds back.
<code>tauR</code> is the torque of an inertia-simulating drive, <code>JR</code> the roller's own
inertia.</p>
<h4>Slots</h4>
<p>Cylinder, actuation, pad friction, contact friction, losses, quantities of the rig and sensors are
replaceable: a new physical effect is a <code>redeclare</code>. A sensor changes its reading and nothing
else. <code>Effects</code> holds a catalogue, and says how several effects share a slot.</p>
<h4>References</h4>
<p>C. Schwarz, J. Brembeck, B. Heckmann (2018), equations (1) to (3).</p>
</html>"));
end MinimalObserver;

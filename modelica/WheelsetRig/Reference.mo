within WheelsetRig;
model Reference "Multibody model of the rig: eight bodies, 21 degrees of freedom"
  parameter Units.Length rW(min=0.1) = 0.46 "Wheel radius";
  parameter Units.Length rR(min=0.1) = 0.70 "Roller radius";
  parameter Units.Length rB(min=0.1) = 0.30 "Radius at which the pads act";
  parameter Units.Inertia JW(min=1.0) = 110.0 "Inertia of the wheelset about its axle";
  parameter Units.Inertia JR(min=1.0) = 1500.0 "Inertia of the roller alone";
  parameter Units.Force Fz(min=1000.0) = 80000.0 "Wheel load at rest";
  parameter Units.FrictionCoefficient muWR(min=0.01) = 0.40 "Friction wheel-rail at zero slip velocity: dry";
  parameter Units.FrictionCoefficient muDC = 0.30 "Friction disc-pad";
  parameter Real muDCunit[3](each unit="1", each min=0) = {1.0, 1.0, 1.0}
    "Friction of each brake unit over muDC";
  parameter Real side[3](each unit="1") = {1.0, 1.0, 1.0}
    "1: pads behind the axle, where the disc moves up; -1: in front of it";
  parameter Units.AngularVelocity omega0(min=1e-6) = 0.05 "Speed below which pad friction is smoothed";
  parameter Contact.PolachParameters polach "Law of the creep force";
  parameter Units.Mass mF = 4000.0 "Mass of the bogie frame";
  parameter Units.Inertia IF[3] = {2500.0, 2200.0, 4500.0} "Moments of inertia of the bogie frame";
  parameter Units.Mass mG(min=1.0) = 150.0 "Mass of a guidance arm";
  parameter Units.Length lG = 0.5
    "From the axle forward to the pivot of the guidance arms; negative: behind it; at least 0.05 m";
  parameter Units.Mass mB(min=1.0) = 110.0 "Mass of a brake unit";
  parameter Units.Length lB = 0.35 "From the pads outward to the pivot of a brake unit";
  parameter Units.Length lC = 0.0 "From the pivot to the centre of gravity of a brake unit";
  parameter Units.Mass mW(min=1.0) = 1900.0 "Mass of the wheelset with discs";
  parameter Units.Inertia IW(min=1.0) = 1150.0 "Inertia of the wheelset about x and z";
  parameter Units.Length yG = 1.0 "Lateral position of axle boxes and cylinders";
  parameter Units.Length yW = 0.75 "Lateral position of the contact points";
  parameter Units.Length yB[3] = {0.35, 0.0, -0.35} "Lateral position of the brake discs";

  input Units.Pressure pB "Brake cylinder pressure";
  input Units.Torque tauR "Torque of the drive on the roller";
  input Real dmuWR(unit="1") "Correction of muWR";
  input Real dmuDC(unit="1") "Correction of muDC";

  output Units.AngularVelocity omegaW(start=0.0, fixed=true, nominal=50.0) "Angular velocity of the wheelset";
  output Units.AngularVelocity omegaR(start=0.0, fixed=true, nominal=50.0) "Angular velocity of the roller";
  output Units.Force Fx = FxL + FxR "Longitudinal creep force of both wheels";
  output Units.Velocity slip = rR*omegaR - rW*omegaW "Slip velocity";
  output Units.Force FxL = contact[1].F "Longitudinal creep force, left";
  output Units.Force FxR = contact[2].F "Longitudinal creep force, right";
  output Units.Force FcellL = longitudinal[1].reading "Load cell of the longitudinal cylinder, left";
  output Units.Force FcellR = longitudinal[2].reading "Load cell of the longitudinal cylinder, right";
  output Units.Force FzL = contact[1].Q "Wheel load, left";
  output Units.Force FzR = contact[2].Q "Wheel load, right";
  output Units.Power discPower[3] = {pads[i].lossPower for i in 1:3} "Heat in each brake disc";
  output Units.Power slipPower = contact[1].slipPower + contact[2].slipPower
    "Heat in the contact of both wheels";
  output Units.AngularVelocity omegaWReading = speedSensorW.y "Reading of speedSensorW";
  output Units.AngularVelocity omegaRReading = speedSensorR.y "Reading of speedSensorR";
  output Units.Force FxReading = forceSensor.y "Reading of forceSensor";

  replaceable Brakes.LinearActuation actuation(pB=pB)
    constrainedby Brakes.PartialActuation(pB=pB) "Brake actuation";
  replaceable Brakes.ConstantPadFriction padFriction[3](
    level={(muDC + dmuDC)*muDCunit[i] for i in 1:3}, each Fperp=actuation.Fperp,
    v={side[i]*pads[i].vSlide for i in 1:3})
    constrainedby Brakes.PartialPadFriction(
    level={(muDC + dmuDC)*muDCunit[i] for i in 1:3}, each Fperp=actuation.Fperp,
    v={side[i]*pads[i].vSlide for i in 1:3}) "Pad friction of each brake unit";
  replaceable Contact.ConstantAdhesion adhesion[2](
    each level=muWR + dmuWR, w={contact[j].w for j in 1:2}, v={contact[j].v for j in 1:2},
    Fx={contact[j].F for j in 1:2})
    constrainedby Contact.PartialAdhesion(
    each level=muWR + dmuWR, w={contact[j].w for j in 1:2}, v={contact[j].v for j in 1:2},
    Fx={contact[j].F for j in 1:2}) "Contact friction of each wheel";
  replaceable Losses.WheelsetLoss wheelsetLoss(omega=omegaW)
    constrainedby Losses.PartialLoss(omega=omegaW) "Bearings and discs of the wheelset";
  replaceable Losses.RollerLoss rollerLoss(omega=omegaR)
    constrainedby Losses.PartialLoss(omega=omegaR) "Bearings and windage of the roller";
  replaceable Sensors.IdealSpeedSensor speedSensorW(u=omegaW)
    constrainedby Sensors.PartialSpeedSensor(u=omegaW) "Speed sensor of the wheelset";
  replaceable Sensors.IdealSpeedSensor speedSensorR(u=omegaR)
    constrainedby Sensors.PartialSpeedSensor(u=omegaR) "Speed sensor of the roller";
  replaceable Sensors.IdealForceSensor forceSensor(
    u=FcellL + FcellR, Q=0.5*(FzL + FzR))
    constrainedby Sensors.PartialForceSensor(
    u=FcellL + FcellR, Q=0.5*(FzL + FzR)) "Sum of the load cells";

  inner Parts.World world
    annotation (Placement(transformation(extent={{-100,80},{-80,100}})));
  Joints.FreeMotion frameMotion "xF, yF, zF, alphaF, betaF, gammaF"
    annotation (Placement(transformation(extent={{-60,80},{-40,100}})));
  Parts.Body frame(m=mF, I=IF) "Bogie frame"
    annotation (Placement(transformation(extent={{-20,80},{0,100}})));
  Parts.GuidanceArm arm[2](each m=mG, each J=20.0, each l=lG) "Left, right"
    annotation (Placement(transformation(extent={{-20,20},{0,40}})));
  Parts.BrakeUnit unit[3](
    each m=mB, each J=8.0, lB={side[i]*lB for i in 1:3}, lC={side[i]*lC for i in 1:3},
    each c=10e6, each d=2650.0, each cPitch=0.5e6, each dPitch=160.0)
    annotation (Placement(transformation(extent={{60,20},{80,40}})));
  Parts.Wheelset wheelset(m=mW, I=IW, J=JW)
    annotation (Placement(transformation(extent={{-20,-60},{0,-40}})));
  Parts.Roller roller(J=JR)
    annotation (Placement(transformation(extent={{-20,-100},{0,-80}})));

  Parts.FixedTranslation pivot[2](r={{lG, yG, 0.0}, {lG, -yG, 0.0}}) "Of the guidance arms"
    annotation (Placement(transformation(extent={{-60,20},{-40,40}})));
  Parts.FixedTranslation springSeat[2](r={{0.0, yG, 0.0}, {0.0, -yG, 0.0}}) "Above the axle boxes"
    annotation (Placement(transformation(extent={{-60,-10},{-40,10}})));
  Parts.FixedTranslation hanger[3](r={{-side[i]*(rB + lB), yB[i], 0.0} for i in 1:3}) "Of the brake units"
    annotation (Placement(transformation(extent={{20,20},{40,40}})));
  Parts.FixedTranslation bearing[2](r={{0.0, yG, 0.0}, {0.0, -yG, 0.0}}) "Of the axle"
    annotation (Placement(transformation(extent={{20,-40},{40,-20}})));
  Parts.FixedTranslation disc[3](r={{0.0, yB[i], 0.0} for i in 1:3}) "Brake discs on the axle"
    annotation (Placement(transformation(extent={{60,-40},{80,-20}})));
  Parts.FixedTranslation wheel[2](r={{0.0, yW, 0.0}, {0.0, -yW, 0.0}}) "Centre of the wheels"
    annotation (Placement(transformation(extent={{20,-70},{40,-50}})));
  Parts.FixedTranslation railLevel[2](r={{0.0, yG, -rW}, {0.0, -yG, -rW}})
    annotation (Placement(transformation(extent={{20,80},{40,100}})));
  Parts.FixedTranslation top[2](r={{xV, yG, 0.0}, {xV, -yG, 0.0}}) "Below the vertical cylinders"
    annotation (Placement(transformation(extent={{20,50},{40,70}})));
  Parts.Fixed mountingRail[2](r={{0.0, yG, -rW}, {0.0, -yG, -rW}})
    annotation (Placement(transformation(extent={{100,80},{80,100}})));
  Parts.Fixed mountingTop[2](r={{xV, yG, 0.0}, {xV, -yG, 0.0}})
    annotation (Placement(transformation(extent={{100,50},{80,70}})));
  Parts.Fixed rollerBearing[2](r={{0.0, yW, -rW - rR}, {0.0, -yW, -rW - rR}})
    annotation (Placement(transformation(extent={{100,-100},{80,-80}})));

  Forces.SpringDamper primary[2](each n={0, 0, 1}, each c=1.22e6, each d=15000.0, each F0=-FP)
    "Primary springs and dampers"
    annotation (Placement(transformation(extent={{-20,-10},{0,10}})));
  Forces.Bushing axleBox[2](
    each c={60e6, 3.9e6, 50e6}, each d={24000.0, 6000.0, 22000.0},
    each cRot={0.0, 0.0, 10000.0}, each dRot={0.0, 0.0, 240.0}, each f0={0.0, 0.0, -FA})
    "Between guidance arms and axle"
    annotation (Placement(transformation(extent={{20,-10},{40,10}})));
  Forces.Cylinder longitudinal[2](each n={1, 0, 0}, each c=78e6, each d=60000.0)
    "On rail level, with load cells; set for a longitudinal mode of 21.6 Hz"
    annotation (Placement(transformation(extent={{70,80},{50,100}})));
  Forces.Cylinder vertical[2](each n={0, 0, 1}, each c=0.3e6, each d=50000.0, each F0=-FV)
    "Press the frame down"
    annotation (Placement(transformation(extent={{70,50},{50,70}})));
  Forces.Cylinder lateral(n={0, 1, 0}, c=10e6, d=50000.0)
    annotation (Placement(transformation(extent={{-60,110},{-40,130}})));
  Forces.Bushing guide(cRot={0.0, 2e9, 0.0}, dRot={0.0, 170000.0, 0.0})
    "Guides of the vertical cylinders hold the frame in pitch"
    annotation (Placement(transformation(extent={{-60,50},{-40,70}})));
  Forces.PadContact pads[3](
    side=side, each rB=rB, each vSmooth=rB*omega0, mu={padFriction[i].mu for i in 1:3},
    each Fperp=actuation.Fperp)
    annotation (Placement(transformation(extent={{60,-10},{80,10}})));
  Forces.WheelRollerContact contact[2](
    each rW=rW, each rR=rR, each Q0=Fz, each polach=polach, mu0={adhesion[j].mu0 for j in 1:2})
    "Left, right"
    annotation (Placement(transformation(extent={{20,-100},{40,-80}})));
  Forces.Torque wheelsetDrag(tau=-wheelsetLoss.tau)
    annotation (Placement(transformation(extent={{-60,-60},{-40,-40}})));
  Forces.Torque drive(tau=tauR - rollerLoss.tau) "Drive, less the losses of the roller"
    annotation (Placement(transformation(extent={{-60,-100},{-40,-80}})));

  Units.AngularAcceleration aW "Angular acceleration of the wheelset";
  Units.AngularAcceleration aR "Angular acceleration of the roller";
  Units.Energy energy "Kinetic energy, energy of position and of springs";
  Units.Power lossPower "Power turned into heat, never negative";
protected
  final parameter Units.Force FV = Fz - 0.5*world.g*(mF + mW + 2.0*mG + 3.0*mB)
    "Force of a vertical cylinder at rest";
  final parameter Units.Force FA = Fz - 0.5*world.g*mW "Load of an axle box at rest";
  final parameter Units.Force FP = FA - 0.5*world.g*mG "Load of a primary spring at rest";
  final parameter Units.Length xV =
    0.5*world.g*(mB*(rB + lB - lC)*sum(side) - mG*lG)/FV "Place of the vertical cylinders: no pitch at rest";
equation
  omegaW = wheelset.omega;
  omegaR = roller.omega;
  aW = der(omegaW);
  aR = der(omegaR);
  assert(abs(lG) >= 0.05, "The guidance arms are too short to turn about their pivots");
  // FV > 0, written in free parameters: compilers may decide conditions on final ones.
  assert(Fz > 0.5*world.g*(mF + mW + 2.0*mG + 3.0*mB),
    "The wheel load Fz is less than the weight of the rig: the vertical cylinders pull");
  energy = frame.energy + wheelset.energy + roller.energy + lateral.energy + guide.energy
    + sum(arm.energy) + sum(unit.energy) + sum(primary.energy) + sum(axleBox.energy)
    + sum(longitudinal.energy) + sum(vertical.energy) + sum(contact.energy);
  lossPower = wheelsetLoss.lossPower + rollerLoss.lossPower + lateral.lossPower + guide.lossPower
    + sum(unit.lossPower) + sum(primary.lossPower) + sum(axleBox.lossPower)
    + sum(longitudinal.lossPower) + sum(vertical.lossPower) + sum(pads.lossPower)
    + sum(contact.lossPower);

  connect(world.frame_b, frameMotion.frame_a);
  connect(frameMotion.frame_b, frame.frame_a);
  connect(world.frame_b, lateral.frame_a);
  connect(lateral.frame_b, frame.frame_a);
  connect(world.frame_b, guide.frame_a);
  connect(guide.frame_b, frame.frame_a);
  for j in 1:2 loop
    connect(frame.frame_a, pivot[j].frame_a);
    connect(pivot[j].frame_b, arm[j].frame_a);
    connect(frame.frame_a, springSeat[j].frame_a);
    connect(springSeat[j].frame_b, primary[j].frame_a);
    connect(primary[j].frame_b, arm[j].frame_b);
    connect(arm[j].frame_b, axleBox[j].frame_a);
    connect(axleBox[j].frame_b, bearing[j].frame_b);
    connect(wheelset.axle, bearing[j].frame_a);
    connect(frame.frame_a, railLevel[j].frame_a);
    connect(mountingRail[j].frame_b, longitudinal[j].frame_a);
    connect(longitudinal[j].frame_b, railLevel[j].frame_b);
    connect(frame.frame_a, top[j].frame_a);
    connect(mountingTop[j].frame_b, vertical[j].frame_a);
    connect(vertical[j].frame_b, top[j].frame_b);
    connect(wheelset.axle, wheel[j].frame_a);
    connect(rollerBearing[j].frame_b, contact[j].frame_a);
    connect(contact[j].frame_b, wheel[j].frame_b);
    connect(roller.flange, contact[j].roller);
    connect(wheelset.spin, contact[j].wheel);
  end for;
  for i in 1:3 loop
    connect(frame.frame_a, hanger[i].frame_a);
    connect(hanger[i].frame_b, unit[i].frame_a);
    connect(unit[i].frame_b, pads[i].frame_b);
    connect(wheelset.axle, disc[i].frame_a);
    connect(disc[i].frame_b, pads[i].frame_a);
    connect(wheelset.spin, pads[i].disc);
  end for;
  connect(wheelsetDrag.flange, wheelset.spin);
  connect(drive.flange, roller.flange);
  annotation (
    experiment(StopTime=40.0, Tolerance=1e-6),
    Documentation(info="<html>
<p>The rig as a tree of bodies. The wheelset hangs on bushings and stands on elastic contacts, so no
loop is closed by joints: 21 degrees of freedom, 42 states.</p>
<table border=\"1\">
<tr><th>body</th><th>joints</th><th>coordinates</th></tr>
<tr><td>bogie frame</td><td>free</td><td>xF yF zF alphaF betaF gammaF</td></tr>
<tr><td>2 guidance arms</td><td>pitch on the frame</td><td>betaG</td></tr>
<tr><td>3 brake units</td><td>bounce and pitch on the frame</td><td>zB betaB</td></tr>
<tr><td>wheelset</td><td>x, y, z, yaw, roll, spin</td><td>xW yW zW alphaW gammaW, spin</td></tr>
<tr><td>roller</td><td>rotation</td><td>spin</td></tr>
</table>
<h4>Rest</h4>
<p>Positions count from rest, where gravity, the vertical cylinders and all springs balance: their
preloads follow from the wheel load <code>Fz</code>, the masses and the levers. All start values
are zero but <code>omegaW</code> and <code>omegaR</code>.</p>
<h4>Decisions</h4>
<ul>
<li><code>muWR</code> is that of the dry contact, since this model stands for the rig; the observer
models start from the mean of what they may meet.</li>
<li>All pads act behind the axle, as in the full observer model: the frame rises in forward braking
and sinks in reverse. The springs of the vertical cylinders then change the wheel loads by a few
percent. <code>side</code> mixes the sides.</li>
<li>On the rollers, x and pitch together find no spring: the frame could tip about rail level. The
guides of the vertical cylinders hold it in pitch.</li>
<li>Longitudinal cylinders and axle boxes are as stiff as the measured mode of 21.6 Hz needs, in
series, with the wheels rolling along: 78 and 60 MN/m each.</li>
</ul>
<h4>Limits</h4>
<p>Rotations other than spin are linear, see <code>Interfaces</code>; the contact stays on the crest
of the roller; lateral creep and spin creepage are neglected. The reaction of bearing friction on
the axle boxes is neglected.</p>
<h4>Slots</h4>
<p>As in <code>MinimalObserver</code>; pad friction is an array of three, contact friction of two.
The force sensor reads the sum of the load cells.</p>
<h4>References</h4>
<p>C. Schwarz, J. Brembeck, B. Heckmann (2018), Table 2; S. Iwnicki (1998), <em>Manchester
benchmarks for rail vehicle simulation</em>, Vehicle System Dynamics 30, 295-313, for masses and
primary suspension.</p>
</html>"));
end Reference;

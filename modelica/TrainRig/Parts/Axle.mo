within TrainRig.Parts;
model Axle "Wheelset with three braked discs, each with its temperature, and slide protection"
  import Rig = WheelsetRig;
  parameter Real r(unit="m", min=0.3, max=0.6) = 0.46 "Wheel radius";
  parameter Real J(unit="kg.m2", min=1.0) = 110.0 "Inertia about the axle";
  parameter Real rB(unit="m", min=0.1) = 0.30 "Radius at which the pads act";
  parameter Real unit[3](each unit="1", each min=0.0) = fill(1.0, 3) "1: the pads of a disc act";
  parameter Real muDC(unit="1", min=0.0, max=1.0) = 0.30 "Friction of the pads";
  parameter Real K0(unit="N", min=1.0) = 12.4e6
    "Creep force of one wheel per creepage at zero slip, at 80 kN";
  parameter Rig.Contact.PolachParameters polach "Law of the creep force";
  input Real v(unit="m/s") "Speed of the vehicle";
  input Real Q(unit="N") "Load of one wheel";
  input Real mu0(unit="1") "Friction wheel-rail at zero slip";
  input Real p(unit="Pa") "Pressure behind the valve of the bogie";
  Real omega(unit="rad/s", start=0.0, fixed=true, nominal=50.0) "Angular velocity";
  Real rate(unit="rad/s2") "Rate of omega";
  Real w(unit="m/s") "Slip velocity, positive in braking";
  Real Fx(unit="N") "Creep force of both wheels, braking";
  Real T[3](each unit="K", each start=323.15, each fixed=true, each nominal=300.0)
    "Temperature of a disc";
  Real tauB(unit="N.m") "Torque of the pads";
  Real discPower[3](each unit="W") "Friction power at a disc";
  Real slipPower(unit="W") "Of the contacts";
  Real lossPower(unit="W") "Of bearings and discs in air";
  Real work(unit="J/m") "Slip work of one wheel along the rail";
  SlideProtection protection(v=v, slip=w/noEvent(max(0.1, v)), rate=rate) "Slide protection";
protected
  Real Fperp(unit="N") "Force of a pad pair";
  Real cooling(unit="W/K") "Of one disc";
  Real sense(unit="1") "1 while the axle turns forward, smoothed about rest";
  Real tauL(unit="N.m") "Losses";
equation
  w = v - r*omega;
  sense = tanh(omega/0.05);
  Fx = 2.0*Rig.Contact.creepForce(
    w, v, Q, Rig.Contact.kalkerStiffness(Q, K0, 80000.0), mu0, polach);
  Fperp = 0.1086*noEvent(max(0.0, p*protection.passed - 25000.0));
  cooling = 1.1*(25.0 + 8.0*((0.65*v)^2 + 1e-4)^0.4);
  for k in 1:3 loop
    discPower[k] = unit[k]*ordinaryFriction(muDC, v, Fperp, T[k])*Fperp*rB*sense*omega;
    37500.0*der(T[k]) = 0.93*discPower[k] - cooling*(T[k] - 293.15);
  end for;
  tauB = sum(unit[k]*ordinaryFriction(muDC, v, Fperp, T[k]) for k in 1:3)*Fperp*rB;
  tauL = 25.0 + 0.6*noEvent(abs(omega)) + 0.004*omega^2;
  der(omega) = rate;
  J*rate = r*Fx - (tauB + tauL)*sense;
  slipPower = Fx*w;
  lossPower = tauL*sense*omega;
  work = 0.5*slipPower/noEvent(max(1.0, v));
end Axle;

within ;
package Gauge "A gauge: reading by what is measured"
  partial model PartialLaw "Slot: what is read beside the scale"
    input Real u(unit="m") "Measured";
    output Real f(unit="N") "Read in addition";
  end PartialLaw;

  model Straight "Null version"
    extends PartialLaw;
  equation
    f = 0.0;
  end Straight;

  model Bend "a scale that bends"
    extends PartialLaw;
    parameter Real b(unit="1/m", min=0.0, max=2.0) = 0.0 "Exponent";
  equation
    f = exp(b*u) - 1.0;
    annotation (__Workbench(effect(size="b", matters=0.01, separation="two readings")));
  end Bend;

  model Ripple "teeth that mesh"
    extends PartialLaw;
    parameter Real k(unit="rad/m", min=-20.0, max=20.0) = 0.0 "Teeth";
  equation
    f = sin(k*u);
    annotation (__Workbench(effect(size="k", matters=0.1, separation="a slow pull")));
  end Ripple;

  model Observer "The gauge that observers run on"
    parameter Real c(unit="N/m") = 2.0 "Scale";
    input Real u(unit="m") "Measured";
    input Real dc(unit="N/m") "Correction of c";
    output Real y(unit="N") = (c + dc)*u + law.f "Reading";
    replaceable Straight law(u=u) constrainedby PartialLaw(u=u) "Law";
  end Observer;
end Gauge;

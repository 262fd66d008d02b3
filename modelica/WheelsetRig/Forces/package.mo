within WheelsetRig;
package Forces "Springs, cylinders, pads and contact between the bodies"
  annotation (Documentation(info="<html>
<p>Springs have no length: their two frames coincide at rest. A static force is given by its
preload; displacements count from rest.</p>
</html>"));
end Forces;
